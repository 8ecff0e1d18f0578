/* Fibre directions of a body: parallel to the line of action, turned by the pennation angle, or as laplace.c
 * and fibre_file.c say. */
#include "core/fibres.h"
#include "core/context.h"
#include "core/line_of_action.h"
#include "core/vec3.h"

#include <string.h>

static void lay_parallel(sphm_body *body, const double direction[3]) {
    for (size_t p = 0; p < body->count; p++)
        memcpy(&body->fibres[3 * p], direction, 3 * sizeof *direction);
}

/* f = cos(angle) axis + sin(angle) wide: turned about the thinnest direction across the axis, so that the
 * fibres lie in the muscle's broad plane, as those of a unipennate muscle do. */
static void lay_pennate(sphm_body *body, double angle_deg) {
    double wide[3], thin[3], direction[3], angle = angle_deg * 3.14159265358979323846 / 180;
    sphm_body_cross_axes(body, wide, thin);
    for (int k = 0; k < 3; k++)
        direction[k] = cos(angle) * body->axis[k] + sin(angle) * wide[k];
    lay_parallel(body, direction);
}

sphm_status sphm_body_lay_fibres(sphm_body *body, const sphm_parameters *parameters, sphm_context *context) {
    switch (parameters->fibres) {
    case SPHM_FIBRES_PARALLEL:
        lay_parallel(body, body->axis);
        return SPHM_OK;
    case SPHM_FIBRES_PENNATE:
        lay_pennate(body, parameters->pennation_angle);
        return SPHM_OK;
    case SPHM_FIBRES_FILE:
        return sphm_body_lay_file(body, parameters->fibre_file, parameters->threads, context);
    case SPHM_FIBRES_LAPLACE:
        return sphm_body_lay_laplace(body, parameters->threads, context);
    default:
        return sphm_fail(context, SPHM_REFUSED_PARAMETER, "fibres is choice %d; there are 0 to %d",
                         parameters->fibres, SPHM_FIBRES_LAPLACE);
    }
}
