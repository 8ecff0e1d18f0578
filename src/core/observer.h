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

#ifdef __cplusplus
extern "C" {
#endif

enum { SPHM_SECTIONS = 20, SPHM_OBSERVER_BLOCK = 1024, SPHM_OBSERVER_NUMBERS = 104 };

typedef struct sphm_observer sphm_observer;

/* x = to + rotation (X - from), and how fast that changes. */
typedef struct sphm_rigid_motion {
    double rotation[9];
    double from_m[3], to_m[3];   /* centroids of the rest shape and of the present one */
    double turning_rad_per_s[3]; /* angular velocity in the frame of the rest shape: d/dt R = R [turning] */
} sphm_rigid_motion;

/* What one look yields before it is turned into an observation. */
typedef struct sphm_sums {
    sphm_rigid_motion motion;
    double section_m[SPHM_SECTIONS][3];    /* centroids; 0 where a section is empty */
    double end_m[2][3], end_m_per_s[2][3]; /* centroids of the two ends, and their velocities */
} sphm_sums;

struct sphm_observer {
    const sphm_model *model; /* borrowed */
    size_t count, blocks;
    int threads;
    size_t memory_bytes;

    /* By id, constant. */
    sphm_real *rest_m;      /* [3 * count], relative to model->frame_m */
    double *rest_volume_m3; /* [count], mass over rest density */
    uint8_t *section;       /* [count], 0 ... SPHM_SECTIONS - 1 */
    uint8_t *end;           /* [count], 1: at the origin, 2: at the insertion, 0 */
    double rest_centre_m[3];
    double rest_section_m[SPHM_SECTIONS][3];
    size_t section_count[SPHM_SECTIONS], end_count[2], region_count[SPHM_REGION_COUNT], outer_count;
    double rest_length_m, rest_radius_m, rest_volume_sum_m3; /* as observed on the rest shape */

    /* By id, of the last look. */
    int32_t *slot;        /* [count], the particle's slot in the state */
    sphm_real *present_m; /* [3 * count], relative to model->frame_m */
    sphm_sums sums;
    double *scratch; /* [SPHM_OBSERVER_NUMBERS * blocks], partial sums of the blocks */

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

/* Fills slot, present_m and sums. */
void sphm_observer_look(sphm_observer *observer, const sphm_state *state);
/* Where the best rigid motion takes a place of the rest shape; both relative to model->frame_m. */
void sphm_observer_carry(const sphm_observer *observer, const double rest_m[3], double place_m[3]);
/* The present position of particle `id` minus the place the best rigid motion takes its rest position to. */
void sphm_observer_displacement(const sphm_observer *observer, size_t id, double displacement_m[3]);
/* Mean distance of the centre region's particles from the centroid of their section, across the carried axis.
 */
double sphm_observer_radius(const sphm_observer *observer);
/* Distance of the centroids of the two ends along the carried line of action, and its rate. */
double sphm_observer_length(const sphm_observer *observer, double *speed_m_per_s);
/* kappa max(0, Vm - Vr), or 0 where the coupling is not through the pressure. */
double sphm_electrical_pressure(const sphm_model *model, double membrane_potential_mV);

/* The muscle's own observer, made when first asked for; NULL, with a message, without memory. */
sphm_observer *sphm_muscle_observer(sphm_muscle *muscle, sphm_context *context);

/* What sphm_muscle_particles(), _observe() and _skin() do, for a state. Of the observation everything but
 * the stimulus is filled. */
sphm_status sphm_observer_particles(sphm_observer *observer, const sphm_state *state,
                                    sphm_particles *particles, sphm_context *context);
sphm_status sphm_observer_observe(sphm_observer *observer, const sphm_state *state,
                                  sphm_observation *observation, sphm_context *context);
/* Mean fibre stretch of what is not attached over optimal_fibre_stretch, as of the last look. */
sphm_status sphm_observer_fibre_length(sphm_observer *observer, double *length, sphm_context *context);
sphm_status sphm_observer_skin(sphm_observer *observer, const sphm_state *state, int field, sphm_skin *skin,
                               sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
