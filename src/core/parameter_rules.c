/* What sphm_parameters_check() checks: every value against its row of the table, then the rules between
 * parameters. A C caller may have written anything into the struct, NaN included. */
#include "core/context.h"
#include "sph_muscle/parameters.h"

#include <math.h>
#include <string.h>

/* Writing a value out and reading it in again applies every check a file's value goes through. */
static sphm_status check_ranges(const sphm_parameters *parameters, sphm_context *context) {
    sphm_parameters scratch = *parameters;
    char text[SPHM_TEXT_SIZE];
    for (size_t i = 0; i < sphm_parameter_count(); i++) {
        const sphm_parameter_info *row = sphm_parameter_row(i);
        const char *value = (const char *)parameters + row->offset;
        if (row->kind == SPHM_KIND_TEXT && !memchr(value, '\0', SPHM_TEXT_SIZE))
            return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                             "parameter '%s' does not end within its %d bytes", row->name, SPHM_TEXT_SIZE);
        sphm_status status = sphm_parameters_get(parameters, row->name, text, sizeof text, context);
        if (status == SPHM_OK)
            status = sphm_parameters_set(&scratch, row->name, text, context);
        if (status != SPHM_OK)
            return status;
    }
    return SPHM_OK;
}

static sphm_status check_potentials(const sphm_parameters *p, sphm_context *context) {
    if (p->resting_potential < p->threshold_potential && p->threshold_potential < p->plateau_potential)
        return SPHM_OK;
    return sphm_fail(
        context, SPHM_REFUSED_PARAMETER,
        "resting_potential is %g mV, threshold_potential %g mV, plateau_potential %g mV; they must "
        "rise in this order",
        p->resting_potential, p->threshold_potential, p->plateau_potential);
}

/* A front c = (1 - 2a) sqrt(k D/2) needs an excitation that is there and a threshold in the lower half. */
static sphm_status check_conduction(const sphm_parameters *p, sphm_context *context) {
    if (p->conduction_velocity == 0)
        return SPHM_OK;
    if (p->excitation_rate == 0)
        return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                         "conduction_velocity is %g m/s, but excitation_rate is 0 uA/mm2; a wave needs an "
                         "excitation_rate above 0",
                         p->conduction_velocity);
    double middle = 0.5 * (p->resting_potential + p->plateau_potential);
    if (p->threshold_potential >= middle)
        return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                         "conduction_velocity is %g m/s, but threshold_potential is %g mV; a wave runs only "
                         "with a threshold below %g mV, half way from resting to plateau potential",
                         p->conduction_velocity, p->threshold_potential, middle);
    return SPHM_OK;
}

static sphm_status check_fibres(const sphm_parameters *p, sphm_context *context) {
    if (p->fibres == SPHM_FIBRES_FILE && !p->fibre_file[0])
        return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                         "fibres is file, but fibre_file is empty; it must name a text file of lines "
                         "'x y z dx dy dz'");
    if (p->fibres != SPHM_FIBRES_FILE && p->fibre_file[0])
        sphm_log(context, SPHM_LOG_WARNING, "fibre_file is ignored: fibres is not 'file'");
    if (p->fibres != SPHM_FIBRES_PENNATE && p->pennation_angle != 0)
        sphm_log(context, SPHM_LOG_WARNING, "pennation_angle is ignored: fibres is not 'pennate'");
    return SPHM_OK;
}

/* Gradients between disordered particles have adjoints that do not leave uniform stress at rest
 * (doc/solid.md): the particles give way. */
static sphm_status check_filling(const sphm_parameters *p, sphm_context *context) {
    if (p->tissue == SPHM_TISSUE_SOLID && p->jitter > 0)
        sphm_log(context, SPHM_LOG_WARNING,
                 "jitter is %g: active solid tissue whose particles are displaced is weaker than its law, by "
                 "a third or more at 0.1; 0 is right for forces",
                 p->jitter);
    return SPHM_OK;
}

/* -1e300 would be in range of nothing, so "automatic" is one value in all three components. */
static int automatic(const double vector[3]) {
    return vector[0] >= SPHM_AUTO;
}

static sphm_status check_line_of_action(const sphm_parameters *p, sphm_context *context) {
    if (automatic(p->origin) || automatic(p->insertion) || memcmp(p->origin, p->insertion, sizeof p->origin))
        return SPHM_OK;
    return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                     "origin and insertion are both [%g, %g, %g] m; they must be two points", p->origin[0],
                     p->origin[1], p->origin[2]);
}

static sphm_status check_colours(const sphm_parameters *p, sphm_context *context) {
    if (p->surface_field_min <= p->surface_field_max)
        return SPHM_OK;
    return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                     "surface_field_min is %g, above surface_field_max, %g; it must not be",
                     p->surface_field_min, p->surface_field_max);
}

static sphm_status check_smoothing(const sphm_parameters *p, sphm_context *context) {
    static const double least = 2;
    if (p->smoothing_ratio == 0 || p->smoothing_ratio >= least)
        return SPHM_OK;
    return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                     "smoothing_ratio is %g; it must be 0 (what suits the tissue) or in %g ... 3",
                     p->smoothing_ratio, least);
}

/* Shorter steps would not move a time of some hours any more, and a second would take for ever. */
static sphm_status check_time_step(const sphm_parameters *p, sphm_context *context) {
    static const double shortest_s = 1e-9;
    if (p->time_step == 0 || p->time_step >= shortest_s)
        return SPHM_OK;
    return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                     "time_step is %g s; it must be 0 (automatic) or at least %g s", p->time_step,
                     shortest_s);
}

static sphm_status check_tendon(const sphm_parameters *p, sphm_context *context) {
    if (p->tendon_stiffness > 0 && p->attachment_fraction == 0)
        return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                         "tendon_stiffness is %g N/m, but attachment_fraction is 0; a tendon needs attached "
                         "tissue to pull at",
                         p->tendon_stiffness);
    if (p->tendon_stiffness == 0 && p->tendon_slack_length > 0)
        sphm_log(context, SPHM_LOG_WARNING, "tendon_slack_length is ignored: tendon_stiffness is 0");
    return SPHM_OK;
}

static sphm_status check_start_up(const sphm_parameters *p, sphm_context *context) {
    if (p->initial_stretch == 1 || (p->settle_time > 0 && p->attachment_fraction > 0))
        return SPHM_OK;
    return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                     "initial_stretch is %g, which needs settle_time above 0 (it is %g s) and "
                     "attachment_fraction above 0 (%g)",
                     p->initial_stretch, p->settle_time, p->attachment_fraction);
}

sphm_status sphm_parameters_check(const sphm_parameters *parameters, sphm_context *context) {
    static sphm_status (*const rules[])(const sphm_parameters *, sphm_context *) = {
        check_ranges,         check_potentials, check_conduction, check_fibres,
        check_line_of_action, check_colours,    check_time_step,  check_tendon,
        check_start_up,       check_smoothing,  check_filling,
    };
    if (!parameters)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "parameters are NULL");
    for (size_t i = 0; i < sizeof rules / sizeof rules[0]; i++) {
        sphm_status status = rules[i](parameters, context);
        if (status != SPHM_OK)
            return status;
    }
    return SPHM_OK;
}
