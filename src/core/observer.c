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

/* Sums over one block of ids, positions relative to the rest centroid. */
typedef struct block_sums {
    double position[3], velocity[3];
    double moment[9], moment_rate[9]; /* sum x X^T, sum v X^T */
    double section[SPHM_SECTIONS][3];
    double end[2][3], end_velocity[2][3];
} block_sums;
_Static_assert(sizeof(block_sums) <= SPHM_OBSERVER_NUMBERS * sizeof(double), "raise SPHM_OBSERVER_NUMBERS");

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
        observer->rest_volume_m3[i] = observer->model->particle_mass_kg / (double)state->rest_density[s];
    }
    double sum[3] = {0, 0, 0};
    for (size_t i = 0; i < observer->count; ++i)
        for (int a = 0; a < 3; ++a)
            sum[a] += (double)observer->rest_m[3 * i + a];
    for (int a = 0; a < 3; ++a)
        observer->rest_centre_m[a] = sum[a] / (double)observer->count;
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
        observer->section[i] = (uint8_t)(section < SPHM_SECTIONS - 1 ? section : SPHM_SECTIONS - 1);
        ++observer->section_count[observer->section[i]];
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
        if (member && !observer->end[i]) {
            observer->end[i] = (uint8_t)(end + 1);
            ++observer->end_count[end];
        }
    }
}

static void count_regions(sphm_observer *observer) {
    for (size_t i = 0; i < observer->count; ++i) {
        ++observer->region_count[observer->model->body.region[i]];
        observer->outer_count += observer->model->body.outer[i] != 0;
    }
}

/* Adds one particle at x (relative to the rest centroid) with velocity v. */
static void add_particle(const sphm_observer *observer, size_t i, const double x[3], const double v[3],
                         block_sums *sums) {
    double rest[3];
    for (int a = 0; a < 3; ++a)
        rest[a] = (double)observer->rest_m[3 * i + a] - observer->rest_centre_m[a];
    for (int a = 0; a < 3; ++a) {
        sums->position[a] += x[a];
        sums->velocity[a] += v[a];
        sums->section[observer->section[i]][a] += x[a];
        for (int b = 0; b < 3; ++b) {
            sums->moment[3 * a + b] += x[a] * rest[b];
            sums->moment_rate[3 * a + b] += v[a] * rest[b];
        }
    }
    if (observer->end[i])
        for (int a = 0; a < 3; ++a) {
            sums->end[observer->end[i] - 1][a] += x[a];
            sums->end_velocity[observer->end[i] - 1][a] += v[a];
        }
}

/* Sums one block; `state` NULL: the rest shape, which does not move. */
static void sum_block(sphm_observer *observer, const sphm_state *state, size_t block) {
    block_sums *sums = (block_sums *)observer->scratch + block;
    memset(sums, 0, sizeof *sums);
    const size_t first = block * SPHM_OBSERVER_BLOCK;
    const size_t end =
        first + SPHM_OBSERVER_BLOCK < observer->count ? first + SPHM_OBSERVER_BLOCK : observer->count;
    for (size_t i = first; i < end; ++i) {
        sphm_real *present = observer->present_m + 3 * i;
        double v[3] = {0, 0, 0}, x[3];
        if (state) {
            const int32_t s = observer->slot[i];
            present[0] = state->x[s], present[1] = state->y[s], present[2] = state->z[s];
            v[0] = (double)state->vx[s], v[1] = (double)state->vy[s], v[2] = (double)state->vz[s];
        } else
            memcpy(present, observer->rest_m + 3 * i, 3 * sizeof *present);
        for (int a = 0; a < 3; ++a)
            x[a] = (double)present[a] - observer->rest_centre_m[a];
        add_particle(observer, i, x, v, sums);
    }
}

/* Angular velocity of the best rotation R of A = R S: with Omega = R^T dR/dt skew, R^T dA/dt - (dA/dt)^T R =
 * Omega S + S Omega, whose axial vector is (tr(S) I - S) w. Zero where that leaves w open. */
static void turning(const double rotation[9], const double moment[9], const double rate[9], double w[3]) {
    double s[9], t[9], axial[3], m[9];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            s[3 * i + j] = t[3 * i + j] = 0;
            for (int k = 0; k < 3; ++k) {
                s[3 * i + j] += rotation[3 * k + i] * moment[3 * k + j];
                t[3 * i + j] += rotation[3 * k + i] * rate[3 * k + j];
            }
        }
    axial[0] = t[7] - t[5], axial[1] = t[2] - t[6], axial[2] = t[3] - t[1];
    const double trace = s[0] + s[4] + s[8];
    for (int i = 0; i < 9; ++i)
        m[i] = (i % 4 == 0 ? trace : 0) - s[i];
    const double c0 = m[4] * m[8] - m[5] * m[7], c1 = m[5] * m[6] - m[3] * m[8],
                 c2 = m[3] * m[7] - m[4] * m[6];
    const double determinant = m[0] * c0 + m[1] * c1 + m[2] * c2;
    w[0] = w[1] = w[2] = 0;
    if (!(fabs(determinant) > 1e-9 * trace * trace * trace))
        return;
    w[0] = (c0 * axial[0] + (m[2] * m[7] - m[1] * m[8]) * axial[1] + (m[1] * m[5] - m[2] * m[4]) * axial[2]);
    w[1] = (c1 * axial[0] + (m[0] * m[8] - m[2] * m[6]) * axial[1] + (m[2] * m[3] - m[0] * m[5]) * axial[2]);
    w[2] = (c2 * axial[0] + (m[1] * m[6] - m[0] * m[7]) * axial[1] + (m[0] * m[4] - m[1] * m[3]) * axial[2]);
    for (int a = 0; a < 3; ++a)
        w[a] /= determinant;
}

static void finish(sphm_observer *observer, const block_sums *all) {
    sphm_sums *sums = &observer->sums;
    const double *centre = observer->rest_centre_m;
    sphm_best_rotation(all->moment, sums->motion.rotation);
    turning(sums->motion.rotation, all->moment, all->moment_rate, sums->motion.turning_rad_per_s);
    for (int a = 0; a < 3; ++a) {
        sums->motion.from_m[a] = centre[a];
        sums->motion.to_m[a] = centre[a] + all->position[a] / (double)observer->count;
        for (int k = 0; k < SPHM_SECTIONS; ++k)
            if (observer->section_count[k])
                sums->section_m[k][a] = centre[a] + all->section[k][a] / (double)observer->section_count[k];
        for (int e = 0; e < 2; ++e) {
            sums->end_m[e][a] = centre[a] + all->end[e][a] / (double)observer->end_count[e];
            sums->end_m_per_s[e][a] = all->end_velocity[e][a] / (double)observer->end_count[e];
        }
    }
}

static void sum_all(sphm_observer *observer, const sphm_state *state) {
#pragma omp parallel for schedule(static) num_threads(observer->threads)
    for (size_t block = 0; block < observer->blocks; ++block)
        sum_block(observer, state, block);
    block_sums all;
    memset(&all, 0, sizeof all);
    for (size_t block = 0; block < observer->blocks; ++block) {
        const double *from = (const double *)((const block_sums *)observer->scratch + block);
        for (size_t k = 0; k < sizeof all / sizeof(double); ++k)
            ((double *)&all)[k] += from[k];
    }
    finish(observer, &all);
}

/* What the rest shape measures, by the same sums. */
static void look_at_rest(sphm_observer *observer) {
    sum_all(observer, NULL);
    observer->rest_length_m = sphm_observer_length(observer, NULL);
    observer->rest_radius_m = sphm_observer_radius(observer);
    memcpy(observer->rest_section_m, observer->sums.section_m, sizeof observer->rest_section_m);
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
    made->section = take(made, made->count, sizeof *made->section);
    made->end = take(made, made->count, sizeof *made->end);
    made->slot = take(made, made->count, sizeof *made->slot);
    made->present_m = take(made, 3 * made->count, sizeof *made->present_m);
    made->scratch = take(made, SPHM_OBSERVER_NUMBERS * made->blocks, sizeof *made->scratch);
    if (!made->rest_m || !made->rest_volume_m3 || !made->section || !made->end || !made->slot ||
        !made->present_m || !made->scratch) {
        sphm_observer_destroy(made);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to observe %zu particles",
                         model->body.count);
    }
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
    free(observer->section);
    free(observer->end);
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
    for (size_t s = 0; s < state->count; ++s)
        observer->slot[state->id[s]] = (int32_t)s;
    sum_all(observer, state);
}

void sphm_observer_carry(const sphm_observer *observer, const double rest_m[3], double place_m[3]) {
    const sphm_rigid_motion *motion = &observer->sums.motion;
    double from[3];
    for (int a = 0; a < 3; ++a)
        from[a] = rest_m[a] - motion->from_m[a];
    sphm_multiply3(motion->rotation, from, place_m);
    for (int a = 0; a < 3; ++a)
        place_m[a] += motion->to_m[a];
}

void sphm_observer_displacement(const sphm_observer *observer, size_t id, double displacement_m[3]) {
    const sphm_real *rest = observer->rest_m + 3 * id, *present = observer->present_m + 3 * id;
    const double from[3] = {rest[0], rest[1], rest[2]};
    double carried[3];
    sphm_observer_carry(observer, from, carried);
    for (int a = 0; a < 3; ++a)
        displacement_m[a] = (double)present[a] - carried[a];
}
