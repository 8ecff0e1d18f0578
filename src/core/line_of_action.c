/* The line of action and what follows from it. Reads the particles of a body, writes its axis, the shares
 * along it, attachments, regions and the mid-belly radius. */
#include "core/line_of_action.h"
#include "core/context.h"
#include "core/surface.h"
#include "core/vec3.h"

#include <stdlib.h>
#include <string.h>

/* Shares of the tissue in the regions of the paper. */
#define END_REGION 0.2

static void covariance(const double *positions, size_t points, double mean[3], double matrix[3][3]) {
    double count = (double)points;
    memset(mean, 0, 3 * sizeof *mean);
    memset(matrix, 0, 9 * sizeof **matrix);
    for (size_t p = 0; p < points; p++)
        for (size_t k = 0; k < 3; k++)
            mean[k] += positions[3 * p + k] / count;
    for (size_t p = 0; p < points; p++) {
        double d[3];
        sphm_subtract3(&positions[3 * p], mean, d);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                matrix[i][j] += d[i] * d[j] / count;
    }
}

void sphm_surface_principal_frame(const sphm_surface *surface, double frame[3][3]) {
    double mean[3] = {0, 0, 0}, matrix[3][3] = {{0}}, total = 0, values[3], vector[3], x[3];
    for (int pass = 0; pass < 2; pass++)
        for (size_t t = 0; t < surface->triangle_count; t++) {
            double area = sphm_triangle_area_vector(surface, t, vector);
            for (size_t k = 0; k < 3; k++) {
                x[k] = -mean[k];
                for (size_t c = 0; c < 3; c++)
                    x[k] += surface->vertices[3 * (size_t)surface->triangles[3 * t + c] + k] / 3;
            }
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    matrix[i][j] += pass * area * x[i] * x[j];
            total += area;
            if (pass == 0)
                for (int k = 0; k < 3; k++)
                    mean[k] += (area / total) * x[k];
        }
    sphm_eigen_symmetric3(matrix, values, frame);
}

/* Turns the principal axis so that it runs from origin to insertion. The data do not say which end is which:
 * along z the origin is the upper end, as the proximal end is in a standing subject's frame (z up, as in
 * BodyParts3D); along x or y it is the end with the lower coordinate, as in the preset frame. */
static void orient(double axis[3]) {
    int k = 0;
    for (int d = 1; d < 3; d++)
        if (fabs(axis[d]) > fabs(axis[k]))
            k = d;
    if ((k == 2) == (axis[k] > 0))
        for (int d = 0; d < 3; d++)
            axis[d] = -axis[d];
}

void sphm_principal_ends(const sphm_filling *filling, double ends[2][3]) {
    double mean[3], matrix[3][3], values[3], vectors[3][3], d[3], lower = 0, upper = 0;
    covariance(filling->positions, filling->count, mean, matrix);
    sphm_eigen_symmetric3(matrix, values, vectors);
    double *axis = vectors[0];
    orient(axis);
    for (size_t p = 0; p < filling->count; p++) {
        sphm_subtract3(&filling->positions[3 * p], mean, d);
        lower = fmin(lower, sphm_dot3(d, axis));
        upper = fmax(upper, sphm_dot3(d, axis));
    }
    for (int k = 0; k < 3; k++) {
        ends[0][k] = mean[k] + (lower - 0.5 * filling->spacing_m) * axis[k];
        ends[1][k] = mean[k] + (upper + 0.5 * filling->spacing_m) * axis[k];
    }
}

static int given(const double point[3]) {
    return point[0] != SPHM_AUTO && point[1] != SPHM_AUTO && point[2] != SPHM_AUTO;
}

int sphm_line_of_action_is_given(const sphm_parameters *parameters) {
    return given(parameters->origin) && given(parameters->insertion);
}

/* Where the line of action is a direction of the lattice this is the step in it; in between it blends. */
static double step_along(const sphm_body *body) {
    double square = 0;
    for (int k = 0; k < 3; k++)
        square += pow(sphm_dot3(body->step_m[k], body->axis), 2);
    return sqrt(square);
}

sphm_status sphm_body_find_line_of_action(sphm_body *body, const sphm_parameters *parameters,
                                          const double ends[2][3], sphm_context *context) {
    int has_origin = given(parameters->origin), has_insertion = given(parameters->insertion);
    /* With one point given the other is the end farther from it. */
    if (has_origin)
        memcpy(body->origin_m, parameters->origin, sizeof body->origin_m);
    else
        memcpy(body->origin_m,
               ends[has_insertion && sphm_distance_squared3(ends[1], parameters->insertion) >
                                         sphm_distance_squared3(ends[0], parameters->insertion)],
               sizeof body->origin_m);
    if (has_insertion)
        memcpy(body->insertion_m, parameters->insertion, sizeof body->insertion_m);
    else
        memcpy(body->insertion_m,
               ends[!has_origin || sphm_distance_squared3(ends[1], body->origin_m) >=
                                       sphm_distance_squared3(ends[0], body->origin_m)],
               sizeof body->insertion_m);
    sphm_subtract3(body->insertion_m, body->origin_m, body->axis);
    body->length_m = sphm_normalise3(body->axis);
    if (!(body->length_m > 1e-3 * body->spacing_m))
        return sphm_fail(
            context, SPHM_REFUSED_GEOMETRY,
            "origin and insertion are the same point (%g, %g, %g) m; they span the line of action "
            "and must lie apart",
            body->origin_m[0], body->origin_m[1], body->origin_m[2]);
    body->layer_m = step_along(body);
    return SPHM_OK;
}

/* Shares along the line ------------------------------------------------------------------------------------
 */

typedef struct ranked {
    double along;
    size_t particle;
} ranked;

static int compare_ranked(const void *a, const void *b) {
    const ranked *p = a, *q = b;
    if (p->along != q->along)
        return p->along < q->along ? -1 : 1;
    return p->particle < q->particle ? -1 : p->particle > q->particle;
}

/* Particles level with each other share the volume up to the middle of all of them: a lattice layer across
 * the line of action is attached as a whole or not at all. */
static void share_volume(sphm_body *body, const ranked *order) {
    double below = 0, level = 1e-6 * body->spacing_m;
    for (size_t first = 0, next; first < body->count; first = next) {
        double layer = 0;
        for (next = first; next < body->count && order[next].along - order[first].along < level; next++)
            layer += body->volumes[order[next].particle];
        for (size_t r = first; r < next; r++)
            body->axial_fraction[order[r].particle] = (below + 0.5 * layer) / body->volume_m3;
        below += layer;
    }
}

static void attach_by_share(sphm_body *body, double share) {
    for (size_t p = 0; p < body->count; p++)
        body->attachment[p] = body->axial_fraction[p] < share       ? SPHM_ATTACHED_ORIGIN
                              : 1 - body->axial_fraction[p] < share ? SPHM_ATTACHED_INSERTION
                                                                    : SPHM_FREE;
}

/* The solid is held as if clamped in the sections beyond which the share lies. Its gradients average over the
 * support: tissue beside layers that are held up to x deforms as if it were held SPHM_CLAMP_DEPTH behind x.
 * So the last held layer is the one nearest to that place inside the free part, and every particle up to half
 * a layer further is held; a little less, so that a section that leaves two layers equally near is met alike
 * at both ends. Particles in no layers (jitter, a tilted line) are then held as far inside on average, too.
 */
static sphm_status attach_up_to_sections(sphm_body *body, double share, const sphm_cut_body *whole,
                                         const ranked *order, sphm_context *context) {
    sphm_end_sections(whole, body->axis, share, body->clamp_m);
    size_t last = body->count - 1, loose = 0;
    double inside = (SPHM_CLAMP_DEPTH + 0.5 - 1e-3) * body->layer_m, level = 1e-6 * body->spacing_m,
           lower = fmax(body->clamp_m[0] + inside, order[0].along + level),
           upper = fmin(body->clamp_m[1] - inside, order[last].along - level);
    for (size_t r = 0; r < body->count; r++) {
        body->attachment[order[r].particle] = order[r].along < lower   ? SPHM_ATTACHED_ORIGIN
                                              : order[r].along > upper ? SPHM_ATTACHED_INSERTION
                                                                       : SPHM_FREE;
        loose += body->attachment[order[r].particle] == SPHM_FREE;
    }
    if (loose == 0)
        return sphm_fail(
            context, SPHM_REFUSED_GEOMETRY,
            "attachment_fraction: %g leaves %.3g mm between the ends, and layers of %.3g mm are held at "
            "either side of it: no particle is free. A smaller share or more particles are needed",
            share, 1e3 * (body->clamp_m[1] - body->clamp_m[0]), 1e3 * body->layer_m);
    return SPHM_OK;
}

/* However few particles there are, an end that is to be attached has its first layer. */
static sphm_status attach(sphm_body *body, const sphm_parameters *parameters, const sphm_cut_body *whole,
                          const ranked *order, sphm_context *context) {
    double share = parameters->attachment_fraction, first = body->axial_fraction[order[0].particle];
    if (parameters->tissue == SPHM_TISSUE_SOLID && share > 0)
        return attach_up_to_sections(body, share, whole, order, context);
    attach_by_share(body, share > 0 ? fmax(share, first * 1.000001) : 0);
    return SPHM_OK;
}

sphm_status sphm_body_divide(sphm_body *body, const sphm_parameters *parameters, const sphm_cut_body *whole,
                             sphm_context *context) {
    ranked *order = malloc(body->count * sizeof *order);
    if (!order)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to rank %zu particles", body->count);
    for (size_t p = 0; p < body->count; p++) {
        order[p].along = sphm_dot3(&body->positions[3 * p], body->axis);
        order[p].particle = p;
    }
    qsort(order, body->count, sizeof *order, compare_ranked);
    share_volume(body, order);
    sphm_status status = attach(body, parameters, whole, order, context);
    for (size_t p = 0; p < body->count; p++) {
        double share = body->axial_fraction[p];
        body->region[p] = share < END_REGION       ? SPHM_REGION_ORIGIN
                          : 1 - share < END_REGION ? SPHM_REGION_INSERTION
                                                   : SPHM_REGION_CENTRE;
    }
    free(order);
    return status;
}

/* Area of the section where half of the tissue lies on either side: volume of the particles around it,
 * weighted by a hat that is a whole number of layers wide, so that layers of a lattice count the same
 * wherever they lie. */
void sphm_body_measure_section(sphm_body *body) {
    double middle = 0, lower = INFINITY, upper = -INFINITY, nearest = INFINITY;
    for (size_t p = 0; p < body->count; p++) {
        double along = sphm_dot3(&body->positions[3 * p], body->axis);
        lower = fmin(lower, along);
        upper = fmax(upper, along);
        if (fabs(body->axial_fraction[p] - 0.5) < nearest) {
            nearest = fabs(body->axial_fraction[p] - 0.5);
            middle = along;
        }
    }
    double layers = fmax(2, floor(0.05 * (upper - lower) / body->layer_m));
    double width = layers * body->layer_m, sum = 0;
    for (size_t p = 0; p < body->count; p++)
        sum += body->volumes[p] *
               fmax(0, 1 - fabs(sphm_dot3(&body->positions[3 * p], body->axis) - middle) / width);
    double area = sum / width;
    body->mid_radius_m = sqrt(area / 3.14159265358979323846);
}

void sphm_body_cross_axes(const sphm_body *body, double wide[3], double thin[3]) {
    double mean[3], matrix[3][3], u[3] = {0, 0, 0}, v[3], moved[3];
    /* u and v span the section: v is z (or y) made perpendicular to the axis, as in the preset frame. */
    int up = fabs(body->axis[2]) < 0.9 ? 2 : 1;
    for (int k = 0; k < 3; k++)
        v[k] = (k == up) - body->axis[up] * body->axis[k];
    sphm_normalise3(v);
    sphm_cross3(v, body->axis, u);
    covariance(body->positions, body->count, mean, matrix);
    double uu = 0, uv = 0, vv = 0;
    for (int k = 0; k < 3; k++)
        moved[k] = sphm_dot3(matrix[k], u);
    uu = sphm_dot3(moved, u);
    uv = sphm_dot3(moved, v);
    for (int k = 0; k < 3; k++)
        moved[k] = sphm_dot3(matrix[k], v);
    vv = sphm_dot3(moved, v);
    /* A round or square section has no wide direction: u and v stay. */
    double turn = hypot(uu - vv, 2 * uv) > 1e-6 * (uu + vv) ? 0.5 * atan2(2 * uv, uu - vv) : 0;
    for (int k = 0; k < 3; k++)
        wide[k] = cos(turn) * u[k] + sin(turn) * v[k];
    sphm_cross3(body->axis, wide, thin);
}
