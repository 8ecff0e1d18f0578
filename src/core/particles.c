/* Particle fields by id, in single precision: reads a state through the observer. */
#include <math.h>
#include <stdlib.h>

#include "core/context.h"
#include "core/observer.h"
#include "kernels/vector.h"

/* The buffers: 11 fields, of which three are vectors. */
enum { NUMBERS = 17 };

static void hand_out(const sphm_observer *observer, sphm_particles *particles) {
    const size_t n = observer->count;
    const float *f = observer->fields;
    particles->count = n;
    particles->position_m = f;
    particles->velocity_m_per_s = f + 3 * n;
    particles->displacement_vector_m = f + 6 * n;
    particles->displacement_m = f + 9 * n;
    particles->pressure_Pa = f + 10 * n;
    particles->electrical_pressure_Pa = f + 11 * n;
    particles->density_kg_per_m3 = f + 12 * n;
    particles->membrane_potential_mV = f + 13 * n;
    particles->recovery = f + 14 * n;
    particles->activation = f + 15 * n;
    particles->fibre_stretch = f + 16 * n;
}

/* Buffers and the weights of the fibre stretch, when particles are first asked for. */
static sphm_status prepare(sphm_observer *observer, sphm_context *context) {
    if (observer->fields)
        return SPHM_OK;
    const sphm_body *body = &observer->model->body;
    const sphm_status status = sphm_fibre_weights_create(body->positions, body->fibres, observer->count,
                                                         body->spacing_m, &observer->fibre, context);
    if (status != SPHM_OK)
        return status;
    observer->fields = malloc(NUMBERS * observer->count * sizeof *observer->fields);
    if (!observer->fields) {
        sphm_fibre_weights_free(&observer->fibre);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the fields of %zu particles",
                         observer->count);
    }
    observer->memory_bytes += NUMBERS * observer->count * sizeof *observer->fields +
                              observer->count * sizeof *observer->fibre.row_start +
                              observer->fibre.row_start[observer->count] * 8;
    return SPHM_OK;
}

static void gather(const sphm_observer *observer, const sphm_state *state, size_t i) {
    const size_t n = observer->count, s = (size_t)observer->slot[i];
    const double v[3] = {(double)state->vx[s], (double)state->vy[s], (double)state->vz[s]};
    const double potential_mV = (double)state->membrane_potential[s];
    float *f = observer->fields;
    double d[3];
    sphm_observer_displacement(observer, i, d);
    for (size_t a = 0; a < 3; ++a) {
        f[3 * i + a] = (float)((double)observer->present_m[3 * i + a] + observer->model->frame_m[a]);
        f[3 * n + 3 * i + a] = (float)v[a];
        f[6 * n + 3 * i + a] = (float)d[a];
    }
    f[9 * n + i] = (float)sqrt(sphm_dot3(d, d));
    f[10 * n + i] = (float)state->pressure[s];
    f[11 * n + i] = (float)sphm_electrical_pressure(observer->model, potential_mV);
    f[12 * n + i] = (float)state->density[s];
    f[13 * n + i] = (float)potential_mV;
    f[14 * n + i] = (float)state->recovery[s];
    f[15 * n + i] = (float)state->activation[s];
}

sphm_status sphm_observer_fibre_length(sphm_observer *observer, double *length, sphm_context *context) {
    const sphm_status status = prepare(observer, context);
    if (status != SPHM_OK)
        return status;
    float *stretch = observer->fields + 16 * observer->count;
    double sum = 0, count = 0;
    sphm_fibre_stretch(&observer->fibre, observer->present_m, observer->threads, stretch);
    for (size_t i = 0; i < observer->count; ++i) {
        if (observer->model->body.attachment[i] != SPHM_FREE)
            continue;
        sum += (double)stretch[i];
        ++count;
    }
    *length = count > 0 ? sum / count / observer->model->parameters.optimal_fibre_stretch : 0;
    return SPHM_OK;
}

sphm_status sphm_observer_particles(sphm_observer *observer, const sphm_state *state,
                                    sphm_particles *particles, sphm_context *context) {
    const sphm_status status = prepare(observer, context);
    if (status != SPHM_OK)
        return status;
    sphm_observer_look(observer, state);
#pragma omp parallel for schedule(static) num_threads(observer->threads)
    for (size_t i = 0; i < observer->count; ++i)
        gather(observer, state, i);
    sphm_fibre_stretch(&observer->fibre, observer->present_m, observer->threads,
                       observer->fields + 16 * observer->count);
    hand_out(observer, particles);
    return SPHM_OK;
}
