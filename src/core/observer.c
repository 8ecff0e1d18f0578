/* Looking at a state: order of ids, best rigid motion, centroids of sections and ends. */
#include "core/observer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "core/threads.h"
#include "kernels/vector.h"

/* Where nothing is attached, an end is this share of the tissue. */
static const double END_SHARE = 0.02;

static void *take(sphm_observer *observer, size_t count, size_t size) {
    observer->memory_bytes += count * size;
    return calloc(count ? count : 1, size);
}

/* Rest positions, volumes and their centroid, from the arrays the state keeps beside itself. */
static void copy_rest(sphm_observer *observer, const sphm_state *state) {
    for (size_t s = 0; s < state->count; ++s) {
        const size_t i = (size_t)state->id[s];
        observer->rest_m[3 * i] = state->rest_x[s];
        observer->rest_m[3 * i + 1] = state->rest_y[s];
        observer->rest_m[3 * i + 2] = state->rest_z[s];
        observer->role[i].relative_volume = state->relative_volume[s];
        observer->rest_volume_m3[i] = observer->model->particle_mass_kg * (double)state->relative_volume[s] /
                                      (double)state->rest_density[s];
    }
    double sum[3] = {0, 0, 0};
    for (size_t i = 0; i < observer->count; ++i)
        for (int a = 0; a < 3; ++a)
            sum[a] += (double)observer->rest_m[3 * i + a];
    for (int a = 0; a < 3; ++a)
        observer->look.rest_centre_m[a] = sum[a] / (double)observer->count;
    for (size_t i = 0; i < observer->count; ++i)
        observer->rest_volume_sum_m3 += observer->rest_volume_m3[i];
}

static double along_axis(const sphm_observer *observer, size_t i) {
    const double x[3] = {observer->rest_m[3 * i], observer->rest_m[3 * i + 1], observer->rest_m[3 * i + 2]};
    return sphm_dot3(x, observer->model->body.axis);
}

/* Slices of equal thickness between the first and the last particle along the line of action. */
static void divide_sections(sphm_observer *observer) {
    double lowest = INFINITY, highest = -INFINITY;
    for (size_t i = 0; i < observer->count; ++i) {
        lowest = fmin(lowest, along_axis(observer, i));
        highest = fmax(highest, along_axis(observer, i));
    }
    const double thickness = (highest - lowest) / SPHM_SECTIONS;
    for (size_t i = 0; i < observer->count; ++i) {
        const double section = thickness > 0 ? (along_axis(observer, i) - lowest) / thickness : 0;
        observer->role[i].section = (uint8_t)(section < SPHM_SECTIONS - 1 ? section : SPHM_SECTIONS - 1);
        ++observer->look.section_count[observer->role[i].section];
    }
}

/* The two ends: what is attached there, else the outermost slice, else the outermost particle. */
static void find_end(sphm_observer *observer, int end) {
    const sphm_body *body = &observer->model->body;
    const int attached = end == 0 ? SPHM_ATTACHED_ORIGIN : SPHM_ATTACHED_INSERTION;
    size_t outermost = 0, by_attachment = 0;
    for (size_t i = 0; i < observer->count; ++i) {
        by_attachment += body->attachment[i] == attached;
        const double ahead = body->axial_fraction[i] - body->axial_fraction[outermost];
        if (end == 0 ? ahead < 0 : ahead > 0)
            outermost = i;
    }
    for (size_t i = 0; i < observer->count; ++i) {
        const double from_end = end == 0 ? body->axial_fraction[i] : 1 - body->axial_fraction[i];
        const int member =
            by_attachment ? body->attachment[i] == attached : from_end <= END_SHARE || i == outermost;
        if (member && !observer->role[i].end) {
            observer->role[i].end = (uint8_t)(end + 1);
            ++observer->look.end_count[end];
        }
    }
}

static void count_regions(sphm_observer *observer) {
    const sphm_body *body = &observer->model->body;
    for (size_t i = 0; i < observer->count; ++i) {
        observer->role[i].region = body->region[i];
        observer->role[i].outer = body->outer[i] != 0;
        observer->role[i].attached = body->attachment[i] != SPHM_FREE;
        ++observer->region_count[body->region[i]];
        observer->outer_count += body->outer[i] != 0;
        observer->free_count += body->attachment[i] == SPHM_FREE;
    }
}

static void set_constants(sphm_observer *observer) {
    const sphm_model *model = observer->model;
    sphm_look_constants *c = &observer->look;
    c->count = (double)observer->count;
    memcpy(c->axis, model->body.axis, sizeof c->axis);
    memcpy(c->frame_m, model->frame_m, sizeof c->frame_m);
    c->particle_mass_kg = model->particle_mass_kg;
    c->resting_mV = model->parameters.resting_potential;
    c->electrical_Pa_per_mV =
        model->parameters.coupling == SPHM_COUPLING_PRESSURE ? model->parameters.electrical_pressure : 0;
}

sphm_look_particle sphm_look_particle_of(const sphm_state *state, size_t s) {
    sphm_look_particle p;
    p.place_m[0] = state->x[s], p.place_m[1] = state->y[s], p.place_m[2] = state->z[s];
    p.velocity_m_per_s[0] = state->vx[s];
    p.velocity_m_per_s[1] = state->vy[s];
    p.velocity_m_per_s[2] = state->vz[s];
    p.density_kg_per_m3 = state->density[s];
    p.pressure_Pa = state->pressure[s];
    p.potential_mV = state->membrane_potential[s];
    p.recovery = state->recovery[s];
    p.activation = state->activation[s];
    p.unused = 0;
    return p;
}

/* Sums one block; `state` NULL: the rest shape, which does not move. */
static void sum_block(sphm_observer *observer, const sphm_state *state, size_t block) {
    sphm_shape_sums *sums = (sphm_shape_sums *)observer->scratch + block;
    memset(sums, 0, sizeof *sums);
    const size_t first = block * SPHM_OBSERVER_BLOCK;
    const size_t end =
        first + SPHM_OBSERVER_BLOCK < observer->count ? first + SPHM_OBSERVER_BLOCK : observer->count;
    for (size_t i = first; i < end; ++i) {
        const sphm_real *rest = observer->rest_m + 3 * i;
        sphm_look_particle p;
        memset(&p, 0, sizeof p);
        if (state)
            p = sphm_look_particle_of(state, (size_t)observer->slot[i]);
        else
            memcpy(p.place_m, rest, sizeof p.place_m);
        memcpy(observer->present_m + 3 * i, p.place_m, sizeof p.place_m);
        sphm_look_add_shape(&observer->look, &observer->role[i], rest, &p, sums);
    }
}

static void sum_all(sphm_observer *observer, const sphm_state *state) {
#pragma omp parallel for schedule(static) num_threads(observer->threads)
    for (size_t block = 0; block < observer->blocks; ++block)
        sum_block(observer, state, block);
    sphm_shape_sums all;
    memset(&all, 0, sizeof all);
    for (size_t block = 0; block < observer->blocks; ++block) {
        const double *from = (const double *)((const sphm_shape_sums *)observer->scratch + block);
        for (size_t k = 0; k < SPHM_SHAPE_NUMBERS; ++k)
            ((double *)&all)[k] += from[k];
    }
    sphm_look_find_shape(&observer->look, &all, &observer->shape);
}

/* What the rest shape measures, by the same sums. */
static void look_at_rest(sphm_observer *observer) {
    sum_all(observer, NULL);
    observer->rest_length_m = sphm_observer_length(observer, NULL);
    memcpy(observer->rest_section_m, observer->shape.section_m, sizeof observer->rest_section_m);
    double *part = observer->scratch, sum = 0;
    for (size_t block = 0; block < observer->blocks; ++block) {
        const size_t first = block * SPHM_OBSERVER_BLOCK;
        part[block] = 0;
        for (size_t i = first; i < first + SPHM_OBSERVER_BLOCK && i < observer->count; ++i)
            if (observer->role[i].region == SPHM_REGION_CENTRE)
                part[block] += sphm_look_radius(&observer->look, &observer->shape, observer->role[i].section,
                                                observer->rest_m + 3 * i);
        sum += part[block];
    }
    const size_t count = observer->region_count[SPHM_REGION_CENTRE];
    observer->rest_radius_m = count ? sum / (double)count : 0;
}

sphm_status sphm_observer_create(const sphm_model *model, const sphm_state *state, sphm_observer **observer,
                                 sphm_context *context) {
    *observer = NULL;
    sphm_observer *made = calloc(1, sizeof *made);
    if (!made)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for an observer");
    made->model = model;
    made->count = model->body.count;
    made->blocks = (made->count + SPHM_OBSERVER_BLOCK - 1) / SPHM_OBSERVER_BLOCK;
    made->threads = sphm_team_size(model->parameters.threads);
    made->rest_m = take(made, 3 * made->count, sizeof *made->rest_m);
    made->rest_volume_m3 = take(made, made->count, sizeof *made->rest_volume_m3);
    made->role = take(made, made->count, sizeof *made->role);
    made->slot = take(made, made->count, sizeof *made->slot);
    made->present_m = take(made, 3 * made->count, sizeof *made->present_m);
    made->scratch = take(made, SPHM_SHAPE_NUMBERS * made->blocks, sizeof *made->scratch);
    if (!made->rest_m || !made->rest_volume_m3 || !made->role || !made->slot || !made->present_m ||
        !made->scratch) {
        sphm_observer_destroy(made);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to observe %zu particles",
                         model->body.count);
    }
    set_constants(made);
    copy_rest(made, state);
    divide_sections(made);
    find_end(made, 0);
    find_end(made, 1);
    count_regions(made);
    look_at_rest(made);
    *observer = made;
    return SPHM_OK;
}

void sphm_observer_destroy(sphm_observer *observer) {
    if (!observer)
        return;
    free(observer->rest_m);
    free(observer->rest_volume_m3);
    free(observer->role);
    free(observer->slot);
    free(observer->present_m);
    free(observer->scratch);
    free(observer->fields);
    sphm_fibre_weights_free(&observer->fibre);
    sphm_skin_weights_free(&observer->skin);
    free(observer->vertices_m);
    free(observer);
}

void sphm_observer_look(sphm_observer *observer, const sphm_state *state) {
    set_constants(observer); /* the model is borrowed: whoever owns it may have set another parameter */
    for (size_t s = 0; s < state->count; ++s)
        observer->slot[state->id[s]] = (int32_t)s;
    sum_all(observer, state);
}
