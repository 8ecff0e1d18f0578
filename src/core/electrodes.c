/* Electrode masks from the rest shape. */
#include "core/electrodes.h"
#include "core/context.h"

#include <math.h>
#include <string.h>

static const char *const names[SPHM_ELECTRODE_COUNT] = {"belly", "origin", "insertion", "both", "sphere"};
/* Share of the tissue, by volume, under an end electrode: what the paper fixes and stimulates. */
static const double end_share = 0.10;

const char *sphm_electrode_name(int electrode) {
    return electrode >= 0 && electrode < SPHM_ELECTRODE_COUNT ? names[electrode] : NULL;
}

int sphm_electrode_find(const char *name) {
    for (int e = 0; e < SPHM_ELECTRODE_COUNT; e++)
        if (name && strcmp(name, names[e]) == 0)
            return e;
    return -1;
}

static int centre_given(const sphm_parameters *p) {
    return p->electrode_centre[0] != SPHM_AUTO;
}

/* The given centre, or the centroid of the middle tenth of the tissue: inside a bowed belly too, where the
 * middle of the line of action need not be. */
static void sphere_centre(const sphm_parameters *p, const sphm_body *body, double centre[3]) {
    double sum[3] = {0, 0, 0};
    size_t counted = 0;
    for (size_t i = 0; i < body->count; i++)
        if (fabs(body->axial_fraction[i] - 0.5) <= 0.05) {
            for (int a = 0; a < 3; a++)
                sum[a] += body->positions[3 * i + a];
            counted++;
        }
    for (int a = 0; a < 3; a++) {
        const double middle = counted ? sum[a] / (double)counted : (body->lower_m[a] + body->upper_m[a]) / 2;
        centre[a] = p->electrode_centre[a] != SPHM_AUTO ? p->electrode_centre[a] : middle;
    }
}

static double distance(const double a[3], const double b[3]) {
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

static uint8_t mark(const sphm_body *body, size_t i, const double centre[3], double radius) {
    const int origin = body->axial_fraction[i] <= end_share;
    const int insertion = body->axial_fraction[i] >= 1 - end_share;
    const int sphere = distance(body->positions + 3 * i, centre) <= radius;
    return (uint8_t)(1 << SPHM_ELECTRODE_BELLY | origin << SPHM_ELECTRODE_ORIGIN |
                     insertion << SPHM_ELECTRODE_INSERTION | (origin || insertion) << SPHM_ELECTRODE_BOTH |
                     sphere << SPHM_ELECTRODE_SPHERE);
}

sphm_status sphm_electrodes_mark(const sphm_parameters *p, const sphm_body *body, uint8_t *mask,
                                 sphm_context *context) {
    double centre[3], nearest = INFINITY;
    size_t in_sphere = 0;
    sphere_centre(p, body, centre);
    for (size_t i = 0; i < body->count; i++) {
        mask[i] = mark(body, i, centre, p->electrode_radius);
        in_sphere += mask[i] >> SPHM_ELECTRODE_SPHERE & 1;
        nearest = fmin(nearest, distance(body->positions + 3 * i, centre));
    }
    if (in_sphere > 0)
        return SPHM_OK;

    static const char text[] =
        "the sphere electrode (electrode_centre %g %g %g m, electrode_radius %g m) contains no "
        "particle; the nearest one is %g m from its centre";
    if (p->electrode == SPHM_ELECTRODE_SPHERE)
        return sphm_fail(context, SPHM_REFUSED_PARAMETER, text, centre[0], centre[1], centre[2],
                         p->electrode_radius, nearest);
    if (centre_given(p))
        sphm_log(context, SPHM_LOG_WARNING, text, centre[0], centre[1], centre[2], p->electrode_radius,
                 nearest);
    return SPHM_OK;
}
