/* Isometric calibration; see calibration.h. The force is nearly proportional to the stress, so that each run
 * scales the next guess; a secant was tried on paper and saves nothing. Passive forces scale with the same
 * stress (Blemker-Delp), so that the curve's shape stays. */
#include "core/calibration.h"

#include <math.h>
#include <string.h>

#include "core/context.h"
#include "core/muscle.h"
#include "core/solid_constants.h"
#include "kernels/vector.h"

#define MOST_PARTICLES 4000
#define FIRST_GUESS_PA 3e5 /* Table 3; not the parameter: a file of the parameters in use gives the same */
#define MOST_PA 1e7
#define UNUSUAL_PA 6e5
#define TOLERANCE 0.003
#define MOST_RUNS 6

/* The same muscle without what does not change its isometric force, settled in few steps. */
static sphm_parameters still(const sphm_parameters *parameters) {
    sphm_parameters p = *parameters;
    p.backend = SPHM_BACKEND_CPU; /* the same stress whatever computes the muscle */
    p.max_isometric_force = 0;
    p.max_isometric_stress = FIRST_GUESS_PA;
    p.particles = p.particles < MOST_PARTICLES ? p.particles : MOST_PARTICLES;
    p.mass_scaling = 4;
    p.velocity_damping = 15;
    p.activation_time = 0.02;
    p.force_velocity = SPHM_FORCE_VELOCITY_OFF;
    p.tendon_stiffness = p.tendon_slack_length = 0;
    p.time_step = 0;
    p.initial_stretch = 1;
    p.settle_time = 0;
    p.stimulus[0] = '\0';
    memset(p.gravity, 0, sizeof p.gravity);
    return p;
}

static double pull_of(const sphm_muscle *muscle, const sphm_wrench *w) {
    return -sphm_dot3(w->force_N, sphm_muscle_body(muscle)->axis);
}

/* At rest with another fibre stress: filling the shape anew would take longer than the run. */
static sphm_status reset_with(sphm_muscle *muscle, double stress_Pa, sphm_context *context) {
    muscle->model.parameters.max_isometric_stress = stress_Pa;
    muscle->model.solid = sphm_solid_constants_from(&muscle->model.parameters);
    return sphm_muscle_reset(muscle, context);
}

static sphm_status isometric_force(sphm_muscle *muscle, double *force_N, sphm_context *context) {
    sphm_wrench w;
    memset(&w, 0, sizeof w);
    sphm_status status = sphm_muscle_activate(muscle, 1, 0, context);
    double before = INFINITY;
    for (int k = 0; k < 12 && status == SPHM_OK; ++k) { /* until it stands still */
        status = sphm_muscle_advance(muscle, k ? 0.05 : 0.15, context);
        if (status == SPHM_OK)
            status = sphm_muscle_wrench(muscle, SPHM_END_INSERTION, &w, context);
        *force_N = status == SPHM_OK ? pull_of(muscle, &w) : 0;
        if (fabs(*force_N - before) < 0.3 * TOLERANCE * fabs(*force_N))
            break;
        before = *force_N;
    }
    return status;
}

/* Runs until the stress gives the target, from that of the new muscle on. */
static sphm_status approach(sphm_muscle *muscle, double target, double *stress_Pa, sphm_context *context) {
    sphm_context quiet;
    memset(&quiet, 0, sizeof quiet);
    double force = 0, stress = muscle->model.parameters.max_isometric_stress;
    for (int run = 0; run < MOST_RUNS && fabs(force - target) > TOLERANCE * target; ++run) {
        stress = force > 0 ? stress * target / force : stress;
        if (!(stress <= MOST_PA))
            return sphm_fail(
                context, SPHM_REFUSED_PARAMETER,
                "max_isometric_force is %g N; this muscle would need a fibre stress of %g Pa, and "
                "at most %g Pa are allowed",
                target, stress, MOST_PA);
        sphm_status status = run > 0 ? reset_with(muscle, stress, &quiet) : SPHM_OK;
        if (status == SPHM_OK)
            status = isometric_force(muscle, &force, &quiet);
        if (status != SPHM_OK || !(force > 0))
            return sphm_fail(
                context, status < 0 || status == SPHM_OK ? SPHM_REFUSED_PARAMETER : status,
                "max_isometric_force is %g N, but the muscle could not be calibrated at %g Pa: %s", target,
                stress, status == SPHM_OK ? "it does not pull" : quiet.message);
    }
    if (fabs(force - target) > 5 * TOLERANCE * target)
        return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                         "max_isometric_force is %g N, but calibration ends at %g N with %g Pa", target,
                         force, stress);
    *stress_Pa = stress;
    return SPHM_OK;
}

sphm_status sphm_calibrate_isometric_stress(const sphm_parameters *parameters, const sphm_surface *mesh,
                                            double *stress_Pa, sphm_context *context) {
    const sphm_parameters p = still(parameters);
    const double target = parameters->max_isometric_force;
    sphm_muscle *muscle = NULL;
    sphm_context quiet;
    memset(&quiet, 0, sizeof quiet);
    sphm_status status = sphm_muscle_create(&p, mesh, &muscle, &quiet);
    if (status != SPHM_OK)
        return sphm_fail(context, status, "%s", quiet.message);
    status = approach(muscle, target, stress_Pa, context);
    sphm_muscle_destroy(muscle);
    if (status != SPHM_OK)
        return status;
    const double stress = *stress_Pa;
    sphm_log(context, stress > UNUSUAL_PA ? SPHM_LOG_WARNING : SPHM_LOG_INFO,
             "max_isometric_force %g N takes max_isometric_stress %g Pa%s", target, stress,
             stress > UNUSUAL_PA ? ", more than the 0.6 MPa that muscle is known for" : "");
    return SPHM_OK;
}
