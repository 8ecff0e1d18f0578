/* The observer looks at a state: it brings it into the order of ids, finds the rigid motion that carries the
 * rest shape best, and owns the buffers that particles.c, observables.c and skin.c hand out.
 *
 * It never changes a state. Sums run over fixed blocks of ids in double, so that neither the thread count
 * nor the slot order touches a bit of what is observed. */
#ifndef SPHM_CORE_OBSERVER_H
#define SPHM_CORE_OBSERVER_H

#include "core/fibre_stretch.h"
#include "core/model.h"
#include "core/skin.h"
#include "core/state.h"
#include "kernels/look.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SPHM_OBSERVER_BLOCK = 1024 };

typedef struct sphm_observer sphm_observer;

struct sphm_observer {
    const sphm_model *model; /* borrowed */
    size_t count, blocks;
    int threads;
    size_t memory_bytes;

    /* By id, constant. */
    sphm_real *rest_m;      /* [3 * count], relative to model->frame_m */
    double *rest_volume_m3; /* [count], mass over rest density */
    sphm_look_role *role;   /* [count] */
    sphm_look_constants look;
    double rest_section_m[SPHM_SECTIONS][3];
    size_t region_count[SPHM_REGION_COUNT], outer_count, free_count;
    double rest_length_m, rest_radius_m, rest_volume_sum_m3; /* as observed on the rest shape */

    /* By id, of the last look. */
    int32_t *slot;        /* [count], the particle's slot in the state */
    sphm_real *present_m; /* [3 * count], relative to model->frame_m */
    sphm_look_shape shape;
    double *scratch; /* [SPHM_SHAPE_NUMBERS * blocks], partial sums of the blocks */

    /* Made when first asked for. */
    float *fields; /* [17 * count]: sphm_particles */
    sphm_fibre_weights fibre;
    sphm_skin_weights skin;
    float *vertices_m, *vertex_field; /* one allocation */
};

/* `model` outlives the observer; `state` is any state of it. */
sphm_status sphm_observer_create(const sphm_model *model, const sphm_state *state, sphm_observer **observer,
                                 sphm_context *context);
void sphm_observer_destroy(sphm_observer *observer); /* NULL is fine */

/* Fills slot, present_m and shape. */
void sphm_observer_look(sphm_observer *observer, const sphm_state *state);
/* Distance of the centroids of the two ends along the carried line of action, and its rate. */
double sphm_observer_length(const sphm_observer *observer, double *speed_m_per_s);
/* The particle in slot `slot` of a state. */
sphm_look_particle sphm_look_particle_of(const sphm_state *state, size_t slot);

/* The muscle's own observer, made when first asked for; NULL, with a message, without memory. */
sphm_observer *sphm_muscle_observer(sphm_muscle *muscle, sphm_context *context);

/* What sphm_muscle_particles(), _observe() and _skin() do, for a state. Of the observation everything but
 * the stimulus is filled. */
sphm_status sphm_observer_particles(sphm_observer *observer, const sphm_state *state,
                                    sphm_particles *particles, sphm_context *context);
sphm_status sphm_observer_observe(sphm_observer *observer, const sphm_state *state,
                                  sphm_observation *observation, sphm_context *context);
/* Everything of an observation that the sums over the particles tell, for the shape in observer->shape. */
void sphm_observer_fill(const sphm_observer *observer, const sphm_field_sums *sums,
                        sphm_observation *observation);
/* The weights of the fibre stretch, when they are first needed. */
sphm_status sphm_observer_prepare(sphm_observer *observer, sphm_context *context);
/* The arrays of sphm_particles in `fields`, as sphm_look_pack() has put them there. */
void sphm_observer_hand_out(const sphm_observer *observer, const float *fields, sphm_particles *particles);
/* Mean fibre stretch of what is not attached over optimal_fibre_stretch, as of the last look. */
sphm_status sphm_observer_fibre_length(sphm_observer *observer, double *length, sphm_context *context);
sphm_status sphm_observer_skin(sphm_observer *observer, const sphm_state *state, int field, sphm_skin *skin,
                               sphm_context *context);
/* The same of particles that are there, at places [3 * count] by id, for the motion in observer->shape. */
sphm_status sphm_observer_drape(sphm_observer *observer, const sphm_particles *particles,
                                const sphm_real *places_m, int field, sphm_skin *skin, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
