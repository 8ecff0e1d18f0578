/* Inside the CPU back end: what its files share. */
#ifndef SPHM_CPU_BACKEND_H
#define SPHM_CPU_BACKEND_H

#include "core/backend.h"
#include "core/diffusion.h"
#include "cpu/fluid.h"
#include "cpu/grid.h"
#include "cpu/neighbours.h"
#include "kernels/fluid_motion.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What one block of particles hands to a reduction. */
typedef struct sphm_block_result {
    double sums[SPHM_MOMENT_SUMS];  /* shape matching */
    size_t pulled[SPHM_MAX_FORCES]; /* particles within reach of each point force */
    double moved2, speed2;          /* largest since the rows were built (m2), largest speed squared */
    int nonfinite;
} sphm_block_result;

struct sphm_backend {
    const sphm_model *model;
    sphm_state state; /* in slot order */
    int threads;
    char device[64];

    /* Rows hold pairs up to h + skin as of the last rebuild; valid until a particle moved half the skin. */
    double skin_m;
    int rows_stale;
    sphm_grid grid;
    sphm_neighbours rows;
    sphm_diffusion diffusion;

    sphm_fluid_packs packs;
    size_t blocks;
    sphm_block_result *results; /* [blocks] */
    sphm_rigid_motion motion;
    double speed_max_m_per_s;
    double rest_density_min, viscous_limit_s;
    double rest_diffusion_ms; /* the diffusion's stable step on the rest shape */
    sphm_timing timing;
};

/* shape_matching.c: the best rigid motion of the whole muscle, from positions and rest positions. */
void sphm_cpu_find_rigid_motion(sphm_backend *backend);
/* prediction.c: predicted velocity (20) and shape matching (21, 23): fills packs predicted. */
void sphm_cpu_predict(sphm_backend *backend, double step_s, const sphm_drive *drive);
/* integrate.c: leap-frog (8), fibre steering, attachments. Returns 0 when a value is not finite. */
int sphm_cpu_integrate(sphm_backend *backend, double step_s);
/* integrate.c: how far particles moved since the rows were built and how fast they are; sets rows_stale. */
void sphm_cpu_measure_motion(sphm_backend *backend);
/* integrate.c: "particle 12 (forces)", the first stage of the last step that was not finite, and in it the
 * first particle by id. */
void sphm_cpu_name_nonfinite(const sphm_backend *backend, char *text, size_t size);
/* rows.c: sorts by the listed positions, rebuilds rows and diffusion weights. */
sphm_status sphm_cpu_build_rows(sphm_backend *backend, sphm_context *context);
/* rows.c: does that with the present positions when the rows are stale. */
sphm_status sphm_cpu_refresh_rows(sphm_backend *backend, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
