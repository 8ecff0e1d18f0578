/* The solid tissue in device memory, and what the host sends with a submission. Plain structs that both
 * compilers lay out alike; pointers are the device's. */
#ifndef SPHM_CUDA_SOLID_LAYOUT_H
#define SPHM_CUDA_SOLID_LAYOUT_H

#include "core/membrane_schedule.h"
#include "cuda/membrane_plan.h"
#include "kernels/look.h"
#include "kernels/membrane.h"
#include "kernels/solid_line.h"
#include "kernels/solid_motion.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SPHM_SUBMISSION_STEPS 32    /* most steps of a submission */
#define SPHM_SOLID_END_PARTIALS 256 /* the same for each end; one thread adds them up */
#define SPHM_SOLID_PARTIALS 1024    /* threads of a reduction; the host adds up what they leave */

enum { SPHM_SOLID_PARTS = 3 }; /* of a wrench: passive, elastic, all */
#define SPHM_SOLID_PART_NUMBERS (SPHM_SOLID_PARTS * 6 * SPHM_SOLID_PARTIALS)

/* What moves an end in a step. */
enum { SPHM_SOLID_FOLLOWS, SPHM_SOLID_PULLED, SPHM_SOLID_SLIDES };
typedef struct sphm_solid_end {
    sphm_end_frame frame; /* after the step; of an end that does not follow its pose written by end_step */
    int moved_by;         /* SPHM_SOLID_...; but for the first, forces move it */
    int tendon;           /* between it and a bone at bone_m */
    double bone_m[3], load_N[3];
} sphm_solid_end;

/* One step. */
typedef struct sphm_solid_plan {
    sphm_solid_mover mover;
    double step_s, keep; /* as in the mover, in double */
    sphm_solid_end ends[SPHM_END_COUNT];
    int commanded;        /* an activation is: the membrane stands still */
    sphm_real target;     /* it */
    sphm_real rate_share; /* of the way that the filtered fibre rate goes; 0 without force-velocity */
    sphm_membrane_plan membrane;
} sphm_solid_plan;

/* A point force; relative to the frame of the state. */
typedef struct sphm_solid_pull {
    double centre_m[3], radius_m, force_N[3];
} sphm_solid_pull;

/* No failure. Else step << 33 | not_finite << 32 | slot: the smallest is the first, and particles turned
 * inside out come before those that are not finite, for they are why the others are not. */
#define SPHM_SOLID_FINE UINT64_MAX

typedef struct sphm_solid_submission {
    uint64_t failure;
    uint32_t hits[SPHM_SUBMISSION_STEPS][SPHM_MAX_FORCES]; /* particles within reach; counted on the device */
    sphm_end_body ends[SPHM_END_COUNT]; /* now; of those that forces move written by end_step */
    uint32_t pull_count;
    sphm_solid_pull pulls[SPHM_MAX_FORCES];
    sphm_membrane_table electrodes;
    sphm_solid_plan plan[SPHM_SUBMISSION_STEPS];
} sphm_solid_submission;

typedef struct sphm_solid_report {
    uint64_t failure;
    sphm_end_body ends[SPHM_END_COUNT];
    sphm_real modulus_Pa[SPHM_SOLID_PARTIALS]; /* largest of the particles t, t + PARTIALS, ... */
} sphm_solid_report;

/* All a thread needs; passed to every launch by value. */
typedef struct sphm_solid_device {
    size_t count; /* particles */
    size_t held_count[SPHM_END_COUNT];
    sphm_solid_tissue tissue;
    sphm_membrane_constants membrane;
    sphm_real particle_volume_m3;
    double frame_m[3], gravity_m_per_s2[3];
    sphm_end_block blocks[SPHM_END_COUNT];
#define ARRAY(type, name, elements, meaning) type *name;
#include "cuda/solid_arrays.inc"
#undef ARRAY
} sphm_solid_device;

enum {
    SPHM_SOLID_HITS,
    SPHM_SOLID_END_FORCE,
    SPHM_SOLID_END_SUM,
    SPHM_SOLID_END_STEP,
    SPHM_SOLID_MOVE,
    SPHM_SOLID_SPREAD,
    SPHM_SOLID_STRAIN,
    SPHM_SOLID_REPORT,
    SPHM_SOLID_PART_STRAIN,
    SPHM_SOLID_PART_FORCE,
    SPHM_SOLID_PART_SUM,
    SPHM_SOLID_SNAPSHOT,
    SPHM_SOLID_STEPS,
    SPHM_SOLID_LAUNCHES
};

/* One launch. */
typedef struct sphm_solid_call {
    int launch;                        /* SPHM_SOLID_... */
    int step;                          /* of the submission; steps: how many; not for parts */
    int launches;                      /* steps: which phases they have, as launches_of() in solid_submit.c */
    int substep;                       /* spread: which diffusion sweep, 0 ... substeps - 2 */
    int with_activation, with_damping; /* part_strain */
    int end;                           /* part_force, part_sum */
    int part;                          /* part_sum: its place */
    double pivot_m[3];                 /* part_sum */
    int buffer;                        /* snapshot: of the potential */
    sphm_look_particle *line;          /* snapshot: [id], on the device */
} sphm_solid_call;

extern const char *const sphm_solid_launch_names[SPHM_SOLID_LAUNCHES]; /* solid_backend.c */

#ifdef __cplusplus
}
#endif
#endif
