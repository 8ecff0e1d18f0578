/* Particle fields by id, in single precision: reads a state through the observer. */
#include <math.h>
#include <stdlib.h>

#include "core/context.h"
#include "core/observer.h"
#include "kernels/vector.h"

void sphm_observer_hand_out(const sphm_observer *observer, const float *f, sphm_particles *particles) {
    const size_t n = observer->count;
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

sphm_status sphm_observer_prepare(sphm_observer *observer, sphm_context *context) {
    if (observer->fibre.row_start)
        return SPHM_OK;
    const sphm_body *body = &observer->model->body;
    const sphm_status status = sphm_fibre_weights_create(body->positions, body->fibres, observer->count,
                                                         body->spacing_m, &observer->fibre, context);
    if (status == SPHM_OK)
        observer->memory_bytes += observer->count * sizeof *observer->fibre.row_start +
                                  observer->fibre.row_start[observer->count] * 8;
    return status;
}

/* The buffers too. */
static sphm_status prepare(sphm_observer *observer, sphm_context *context) {
    const sphm_status status = sphm_observer_prepare(observer, context);
    if (status != SPHM_OK || observer->fields)
        return status;
    observer->fields = malloc(SPHM_LOOK_FIELDS * observer->count * sizeof *observer->fields);
    if (!observer->fields)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the fields of %zu particles",
                         observer->count);
    observer->memory_bytes += SPHM_LOOK_FIELDS * observer->count * sizeof *observer->fields;
    return SPHM_OK;
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
    for (size_t i = 0; i < observer->count; ++i) {
        const sphm_look_particle p = sphm_look_particle_of(state, (size_t)observer->slot[i]);
        sphm_look_pack(&observer->look, &observer->shape.motion, observer->rest_m + 3 * i, &p, i,
                       observer->count, observer->fields);
    }
    sphm_fibre_stretch(&observer->fibre, observer->present_m, observer->threads,
                       observer->fields + 16 * observer->count);
    sphm_observer_hand_out(observer, observer->fields, particles);
    return SPHM_OK;
}
