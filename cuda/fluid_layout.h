/* The fluid tissue in device memory, and what the host sends with a submission.
 * Plain structs that both compilers lay out alike; pointers are the device's.
 */
#ifndef SPHM_CUDA_FLUID_LAYOUT_H
#define SPHM_CUDA_FLUID_LAYOUT_H

#include "core/membrane_schedule.h"
#include "cuda/membrane_plan.h"
#include "kernels/cells.h"
#include "kernels/fluid_motion.h"
#include "kernels/look.h"
#include "kernels/pairs.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SPHM_FLUID_STEPS 32     /* most steps of a submission */
#define SPHM_FLUID_BLOCK 256    /* threads of a block */
#define SPHM_FLUID_PARTIALS 128 /* most blocks of a reduction */

/* One step. */
typedef struct sphm_fluid_plan {
    sphm_real step;  /* s */
    sphm_real pull;  /* 2 m W(0) epsilon of (22) */
    double fastest2; /* of a particle for which the step is still short enough,
                        squared, m2/s2 */
    sphm_prediction prediction;
    sphm_membrane_plan membrane;
} sphm_fluid_plan;

/* No failure. Else step << 40 | stage << 32 | id: the smallest is the first
 * step, in it the first stage, and of its particles the first by id. */
#define SPHM_FLUID_FINE UINT64_MAX

typedef struct sphm_fluid_submission {
    uint64_t failure;
    uint32_t end; /* the last step that is taken: after it rows are out of date or
                     the steps too long */
    uint32_t bad; /* particles that are not finite */
    uint32_t hits[SPHM_FLUID_STEPS][SPHM_MAX_FORCES]; /* particles within reach;
                                                         counted on the device */
    uint32_t pull_count;
    sphm_point_pull pulls[SPHM_MAX_FORCES]; /* without the acceleration, which
                                               hangs on the hits */
    double force_N[SPHM_MAX_FORCES][3];
    sphm_membrane_table electrodes;
    sphm_fluid_plan plan[SPHM_FLUID_STEPS];
} sphm_fluid_submission;

typedef struct sphm_fluid_report {
    uint64_t failure;
    uint32_t end, bad;
    uint64_t entries;                       /* of the rows; more than there is memory for: rows and
                                               weights are those of before */
    double largest[SPHM_FLUID_PARTIALS][3]; /* [block]: bound of the diffusion, move since the rows
                                               were built squared, speed squared */
    uint64_t within; /* pairs within h of the listed positions, both sides; grows with each launch */
} sphm_fluid_report;

typedef struct sphm_fluid_rigid {
    double sums[SPHM_MOMENT_SUMS];
    sphm_goal goal;
    sphm_real rotation[9];
} sphm_fluid_rigid;

/* All a thread needs; passed to every launch by value. */
typedef struct sphm_fluid_device {
    size_t count; /* particles */
    int partials; /* blocks of a reduction */
    sphm_fluid_constants fluid;
    sphm_membrane_constants membrane;
    sphm_force_factors factors;
    int kind;               /* of the forces, SPHM_FORCE_... */
    sphm_real unit;         /* m W(0) */
    sphm_real inverse_h;    /* 1/m */
    sphm_real tension_unit; /* 1/density^2 */
    double mass_kg;
    /* Rows. */
    double edge_m, radius_m; /* least edge of a cell; h and the skin */
    double stale_m2;         /* rows are out of date when a particle has moved farther,
                                squared */
    uint64_t capacity;       /* of neighbour and weight */
    int32_t *neighbour;      /* [row_start[i] + k]: slot; fill */
    sphm_real *weight;       /* [row_start[i] + k]: diffusion weight, 1/ms; weigh */
    /* Diffusion weights, as in src/core/diffusion.c. */
    int laplacian;
    sphm_real pair_factor;
    double along, across; /* 1/ms */
    size_t scratch_bytes; /* what the sort needs */
    int key_bits;         /* that hold every cell */
#define ARRAY(type, name, elements, meaning) type *name;
#define SORTED(type, name, numbers, meaning) type *name, *spare_##name;
#include "cuda/fluid_arrays.inc"
} sphm_fluid_device;

enum {
    /* Rows anew. */
    SPHM_FLUID_LIST,
    SPHM_FLUID_BOX,
    SPHM_FLUID_LAY_OUT,
    SPHM_FLUID_BIN,
    SPHM_FLUID_SORT,
    SPHM_FLUID_STARTS,
    SPHM_FLUID_REORDER,
    SPHM_FLUID_SETTLE,
    SPHM_FLUID_COUNT,
    SPHM_FLUID_SCAN,
    SPHM_FLUID_FILL,
    SPHM_FLUID_CORRECT,
    SPHM_FLUID_WEIGH,
    /* A step. */
    SPHM_FLUID_SUM,
    SPHM_FLUID_RIGID,
    SPHM_FLUID_PREDICT,
    SPHM_FLUID_SMOOTH,
    SPHM_FLUID_SPREAD,
    SPHM_FLUID_FORCE,
    /* For the host. */
    SPHM_FLUID_REPORT,
    SPHM_FLUID_SET_REST,
    SPHM_FLUID_WITHIN,
    SPHM_FLUID_SNAPSHOT,
    SPHM_FLUID_LAUNCHES
};

/* One launch. */
typedef struct sphm_fluid_call {
    int launch;               /* SPHM_FLUID_... */
    int step;                 /* of the submission */
    int substep;              /* spread: which diffusion sweep, 0 ... substeps - 2 */
    int buffer;               /* snapshot: of the potential */
    sphm_look_particle *line; /* snapshot: [id], on the device */
} sphm_fluid_call;

extern const char *const sphm_fluid_launch_names[SPHM_FLUID_LAUNCHES]; /* fluid_backend.c */

#ifdef __cplusplus
}
#endif
#endif
