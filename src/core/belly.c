/* The built-in shapes: two muscles, a spindle with the user's sizes, a bar. Writes closed surfaces, turned
 * outwards, in the preset frame: x from origin to insertion, y the widest direction, ends on the x axis. */
#include "core/belly.h"
#include "core/context.h"
#include "core/surface.h"
#include "core/vec3.h"

#include <string.h>

#define PI 3.14159265358979323846
#define SECTORS 48 /* of a ring */
#define SLICES 40  /* between rings along a belly */
#define CAP_RINGS 3
#define BAR_QUADS 1600 /* about, on all six faces */

/* The two muscles are fitted to surfaces of BodyParts3D (FMA37699 and FMA38930), millimetres and cm3:
 *   length     263.2 and 442.7, the longest side of the bounding box
 *   volume     139.9 and 432.9, by the exponent
 *   mid-belly  42 x 29 and 76.5 x 35, the ellipses with the second moments of the sections of the filled
 *              surfaces; their areas, 957 and 2103 mm2, are the sections' too
 *   ends       radius 7, the sections near the ends (100 to 250 mm2)
 *   bow        12 and 15, the sweep of the sections' centroids
 * The muscles lie obliquely in their boxes and their own long axes measure 270 and 443 mm. The side of the
 * box is taken as the length because the paper's lengths are relative to it (parameter paper_units). */
static const sphm_belly triceps_long_head = {0.2632, 0.042, 0.029, 0.007, 0.012, 1.776};
static const sphm_belly vastus_lateralis = {0.4427, 0.0765, 0.035, 0.007, 0.015, 2.130};

sphm_belly sphm_belly_preset(const sphm_parameters *parameters) {
    if (parameters->preset == SPHM_PRESET_TRICEPS_LONG_HEAD)
        return triceps_long_head;
    if (parameters->preset == SPHM_PRESET_VASTUS_LATERALIS)
        return vastus_lateralis;
    sphm_belly belly = {parameters->belly_length,     parameters->belly_width, parameters->belly_thickness,
                        parameters->belly_end_radius, parameters->belly_bow,   1.0};
    return belly;
}

/* Vertex `sector` of a ring at x = s length, scaled towards the middle of its section. A polygon inscribed in
 * an ellipse has too little area: `swell` makes up for it, so that volumes are those of the formula. */
static void ring_vertex(const sphm_belly *belly, double s, double scale, int sector, double out[3]) {
    double swell = sqrt(2 * PI / (SECTORS * sin(2 * PI / SECTORS)));
    double arch = sin(PI * s) > 0 ? sin(PI * s) : 0;
    double profile = pow(arch, belly->exponent), angle = 2 * PI * sector / SECTORS;
    double half_width = belly->end_radius_m + (0.5 * belly->width_m - belly->end_radius_m) * profile;
    double half_thickness = belly->end_radius_m + (0.5 * belly->thickness_m - belly->end_radius_m) * profile;
    out[0] = (s - 0.5) * belly->length_m;
    out[1] = swell * scale * half_width * cos(angle);
    out[2] = swell * scale * half_thickness * sin(angle) + belly->bow_m * arch;
}

static void add_triangle(sphm_surface *surface, int a, int b, int c) {
    int32_t *t = &surface->triangles[3 * surface->triangle_count++];
    t[0] = a;
    t[1] = b;
    t[2] = c;
}

static void add_quad(sphm_surface *surface, int a, int b, int c, int d) {
    add_triangle(surface, a, b, c);
    add_triangle(surface, a, c, d);
}

/* Rings in a row: cap at the origin (growing), belly, cap at the insertion (shrinking); a point at each end.
 */
sphm_status sphm_belly_surface(const sphm_belly *belly, sphm_surface *surface, sphm_context *context) {
    int caps = belly->end_radius_m > 0 ? CAP_RINGS - 1 : 0;
    int rings = SLICES + 1 + 2 * caps;
    sphm_status status =
        sphm_surface_allocate(surface, (size_t)(rings * SECTORS + 2), (size_t)(2 * rings * SECTORS), context);
    if (status != SPHM_OK)
        return status;
    for (int r = 0; r < rings; r++) {
        int slice = r < caps ? 0 : r >= rings - caps ? SLICES : r - caps;
        int inset = r < caps ? r + 1 : r >= rings - caps ? rings - r : CAP_RINGS;
        for (int k = 0; k < SECTORS; k++)
            ring_vertex(belly, (double)slice / SLICES, (double)inset / CAP_RINGS, k,
                        &surface->vertices[3 * (r * SECTORS + k)]);
    }
    int first = rings * SECTORS, last = first + 1;
    ring_vertex(belly, 0, 0, 0, &surface->vertices[3 * first]);
    ring_vertex(belly, 1, 0, 0, &surface->vertices[3 * last]);
    surface->triangle_count = 0;
    for (int k = 0; k < SECTORS; k++) {
        int next = (k + 1) % SECTORS;
        add_triangle(surface, first, next, k);
        for (int r = 0; r + 1 < rings; r++)
            add_quad(surface, r * SECTORS + k, r * SECTORS + next, (r + 1) * SECTORS + next,
                     (r + 1) * SECTORS + k);
        add_triangle(surface, last, (rings - 1) * SECTORS + k, (rings - 1) * SECTORS + next);
    }
    return SPHM_OK;
}

/* One face of the bar: a grid over the axes u and v at the coordinate w = side. Neighbouring faces compute
 * the same coordinates on their common edge, so that welding closes the box. */
static void add_face(sphm_surface *surface, const double half[3], const int cells[3], int w, int side) {
    int u = (w + 1) % 3, v = (w + 2) % 3, base = (int)surface->vertex_count;
    for (int j = 0; j <= cells[v]; j++)
        for (int i = 0; i <= cells[u]; i++) {
            double *x = &surface->vertices[3 * surface->vertex_count++];
            x[u] = half[u] * (2.0 * i / cells[u] - 1);
            x[v] = half[v] * (2.0 * j / cells[v] - 1);
            x[w] = half[w] * side;
        }
    int row = cells[u] + 1;
    for (int j = 0; j < cells[v]; j++)
        for (int i = 0; i < cells[u]; i++) {
            int a = base + j * row + i;
            if (side > 0)
                add_quad(surface, a, a + 1, a + row + 1, a + row);
            else
                add_quad(surface, a, a + row, a + row + 1, a + 1);
        }
}

sphm_status sphm_bar_surface(double length_m, double width_m, double thickness_m, sphm_surface *surface,
                             sphm_context *context) {
    double side[3] = {length_m, width_m, thickness_m}, half[3];
    double area = 2 * (side[0] * side[1] + side[1] * side[2] + side[2] * side[0]);
    int cells[3];
    for (int k = 0; k < 3; k++) {
        half[k] = 0.5 * side[k];
        cells[k] = (int)fmin(fmax(side[k] / sqrt(area / BAR_QUADS) + 0.5, 1), BAR_QUADS);
    }
    size_t vertices = 0, triangles = 0;
    for (int w = 0; w < 3; w++) {
        size_t u = (size_t)cells[(w + 1) % 3], v = (size_t)cells[(w + 2) % 3];
        vertices += 2 * (u + 1) * (v + 1);
        triangles += 4 * u * v;
    }
    sphm_status status = sphm_surface_allocate(surface, vertices, triangles, context);
    if (status != SPHM_OK)
        return status;
    surface->vertex_count = surface->triangle_count = 0;
    for (int w = 0; w < 3; w++) {
        add_face(surface, half, cells, w, -1);
        add_face(surface, half, cells, w, 1);
    }
    return SPHM_OK;
}

sphm_status sphm_surface_preset(const sphm_parameters *parameters, sphm_surface *surface,
                                sphm_context *context) {
    memset(surface, 0, sizeof *surface);
    sphm_status status;
    if (parameters->preset == SPHM_PRESET_BAR) {
        status = sphm_bar_surface(parameters->belly_length, parameters->belly_width,
                                  parameters->belly_thickness, surface, context);
    } else {
        sphm_belly belly = sphm_belly_preset(parameters);
        status = sphm_belly_surface(&belly, surface, context);
    }
    /* Welds the edges of the bar and the tips of a belly whose ends have no radius. */
    if (status == SPHM_OK)
        status = sphm_surface_repair(surface, NULL, context);
    if (status != SPHM_OK)
        sphm_surface_free(surface);
    return status;
}
