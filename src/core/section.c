/* Sections that cut a share of the volume off; see section.h. */
#include "core/section.h"
#include "core/surface.h"
#include "core/vec3.h"

/* The box is halved this often: to 1e-14 of its length. Of points, which are many, to 1e-9; what lies below
 * grows with the section in straight lines there, and in the rest one is taken. */
#define HALVINGS 46
#define HALVINGS_OF_POINTS 30

static void order(double x[3]) {
    for (int k = 0; k < 3; k++) {
        int a = k % 2;
        if (x[a] > x[a + 1]) {
            double swap = x[a];
            x[a] = x[a + 1];
            x[a + 1] = swap;
        }
    }
}

/* Mean over a triangle of what a point lies below `at`, 0 above it. x: of its corners, in order. The part
 * below (or what is missing of it) is a triangle again, on which the mean of a linear function is a third of
 * its value at the corner. */
static double mean_depth(const double x[3], double at) {
    if (at <= x[0])
        return 0;
    if (at <= x[1])
        return pow(at - x[0], 3) / (3 * (x[1] - x[0]) * (x[2] - x[0]));
    double depth = at - (x[0] + x[1] + x[2]) / 3;
    if (at < x[2])
        depth += pow(x[2] - at, 3) / (3 * (x[2] - x[1]) * (x[2] - x[0]));
    return depth;
}

/* By the divergence theorem: the field (x - at) e_x has the divergence 1 and vanishes in the section, so that
 * the triangles below it say the volume without a lid,
 *     V = - sum over triangles of n_x A mean(max(at - x, 0)). */
static double surface_below(const sphm_surface *surface, const double axis[3], double at) {
    double volume = 0;
    for (size_t t = 0; t < surface->triangle_count; t++) {
        double x[3], area[3];
        for (size_t c = 0; c < 3; c++)
            x[c] = sphm_dot3(&surface->vertices[3 * (size_t)surface->triangles[3 * t + c]], axis);
        order(x);
        if (x[0] >= at)
            continue;
        sphm_triangle_area_vector(surface, t, area);
        volume -= sphm_dot3(area, axis) * mean_depth(x, at);
    }
    return volume;
}

static double points_below(const sphm_cut_body *body, const double axis[3], double at) {
    double cells = 0;
    for (size_t p = 0; p < body->count; p++) {
        double depth = (at - sphm_dot3(&body->points[3 * p], axis)) / body->layer_m;
        cells += fmax(0, fmin(1, depth + 0.5));
    }
    return cells;
}

static double below(const sphm_cut_body *body, const double axis[3], double at) {
    return body->surface ? surface_below(body->surface, axis, at) : points_below(body, axis, at);
}

/* Along the direction; lower and upper bound of the body. */
static void bounds(const sphm_cut_body *body, const double axis[3], double bound[2]) {
    const double *points = body->surface ? body->surface->vertices : body->points;
    size_t count = body->surface ? body->surface->vertex_count : body->count;
    double margin = body->surface ? 0 : 0.5 * body->layer_m;
    bound[0] = INFINITY;
    bound[1] = -INFINITY;
    for (size_t p = 0; p < count; p++) {
        double x = sphm_dot3(&points[3 * p], axis);
        bound[0] = fmin(bound[0], x - margin);
        bound[1] = fmax(bound[1], x + margin);
    }
}

double sphm_share_below(const sphm_cut_body *body, const double axis[3], double at_m) {
    double bound[2];
    bounds(body, axis, bound);
    return below(body, axis, at_m) / below(body, axis, bound[1]);
}

/* Below which `wanted` lies, between the bounds, of which nothing and `whole` do. */
static double section_of(const sphm_cut_body *body, const double axis[3], const double bound[2], double whole,
                         double wanted) {
    const int halvings = body->surface ? HALVINGS : HALVINGS_OF_POINTS;
    double at[2] = {bound[0], bound[1]}, volume[2] = {0, whole};
    for (int k = 0; k < halvings; k++) {
        double middle = 0.5 * (at[0] + at[1]), below_it = below(body, axis, middle);
        int side = !(below_it < wanted);
        at[side] = middle;
        volume[side] = below_it;
    }
    double share =
        body->surface || !(volume[1] > volume[0]) ? 0.5 : (wanted - volume[0]) / (volume[1] - volume[0]);
    return at[0] + share * (at[1] - at[0]);
}

void sphm_end_sections(const sphm_cut_body *body, const double axis[3], double share, double sections_m[2]) {
    double bound[2];
    bounds(body, axis, bound);
    double whole = below(body, axis, bound[1]);
    for (int end = 0; end < 2; end++)
        sections_m[end] = section_of(body, axis, bound, whole, (end ? 1 - share : share) * whole);
}
