/* Triangle surfaces: copying, and repairing what mesh files bring. Reads and writes sphm_surface.
 *
 * Real meshes are soups: every STL triangle has its own vertices, parts are open, fragments float about. We
 * weld, measure and drop, but do not close holes: the winding number (winding.h) decides what is inside. */
#include "core/context.h"
#include "core/surface.h"
#include "core/vec3.h"

#include <stdlib.h>
#include <string.h>

/* A connected piece with less than this share of the area is a fragment. */
#define FRAGMENT_SHARE 0.01
/* Less volume than this share of (area)^(3/2) is no solid: a sphere has 0.094, a strip of paper 0. */
#define FLATNESS 1e-6

void sphm_surface_free(sphm_surface *surface) {
    if (!surface)
        return;
    free(surface->vertices);
    free(surface->triangles);
    memset(surface, 0, sizeof *surface);
}

sphm_status sphm_surface_allocate(sphm_surface *surface, size_t vertices, size_t triangles,
                                  sphm_context *context) {
    memset(surface, 0, sizeof *surface);
    surface->vertices = malloc((vertices ? vertices : 1) * 3 * sizeof *surface->vertices);
    surface->triangles = malloc((triangles ? triangles : 1) * 3 * sizeof *surface->triangles);
    if (!surface->vertices || !surface->triangles) {
        sphm_surface_free(surface);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for a surface of %zu triangles", triangles);
    }
    surface->vertex_count = vertices;
    surface->triangle_count = triangles;
    return SPHM_OK;
}

sphm_status sphm_surface_copy(const sphm_surface *from, sphm_surface *to, sphm_context *context) {
    sphm_status status = sphm_surface_allocate(to, from->vertex_count, from->triangle_count, context);
    if (status != SPHM_OK)
        return status;
    if (from->vertex_count)
        memcpy(to->vertices, from->vertices, from->vertex_count * 3 * sizeof *to->vertices);
    if (from->triangle_count)
        memcpy(to->triangles, from->triangles, from->triangle_count * 3 * sizeof *to->triangles);
    return SPHM_OK;
}

static const double *corner(const sphm_surface *surface, size_t triangle, int k) {
    return &surface->vertices[3 * (size_t)surface->triangles[3 * triangle + (size_t)k]];
}

double sphm_triangle_area_vector(const sphm_surface *surface, size_t triangle, double out[3]) {
    double u[3], v[3];
    sphm_subtract3(corner(surface, triangle, 1), corner(surface, triangle, 0), u);
    sphm_subtract3(corner(surface, triangle, 2), corner(surface, triangle, 0), v);
    sphm_cross3(u, v, out);
    for (int k = 0; k < 3; k++)
        out[k] *= 0.5;
    return sphm_norm3(out);
}

static sphm_status check(const sphm_surface *surface, sphm_context *context) {
    if (surface->triangle_count == 0 || surface->vertex_count == 0)
        return sphm_fail(context, SPHM_REFUSED_GEOMETRY,
                         "the mesh is empty (%zu vertices, %zu triangles); a closed surface is needed",
                         surface->vertex_count, surface->triangle_count);
    if (surface->vertex_count > INT32_MAX || surface->triangle_count > INT32_MAX / 3)
        return sphm_fail(context, SPHM_REFUSED_GEOMETRY,
                         "the mesh has %zu vertices and %zu triangles; at most %d triangles can be taken",
                         surface->vertex_count, surface->triangle_count, INT32_MAX / 3);
    for (size_t v = 0; v < 3 * surface->vertex_count; v++)
        if (!isfinite(surface->vertices[v]))
            return sphm_fail(context, SPHM_REFUSED_GEOMETRY,
                             "vertex %zu of the mesh has the coordinate %g; all must be finite", v / 3,
                             surface->vertices[v]);
    for (size_t t = 0; t < 3 * surface->triangle_count; t++)
        if (surface->triangles[t] < 0 || (size_t)surface->triangles[t] >= surface->vertex_count)
            return sphm_fail(context, SPHM_REFUSED_GEOMETRY,
                             "triangle %zu of the mesh names vertex %d; there are %zu vertices", t / 3,
                             (int)surface->triangles[t], surface->vertex_count);
    return SPHM_OK;
}

/* Welding ------------------------------------------------------------------------------------------------ */

typedef struct keyed_vertex {
    double x[3];
    int32_t vertex;
} keyed_vertex;

static int compare_vertices(const void *a, const void *b) {
    const keyed_vertex *p = a, *q = b;
    for (int k = 0; k < 3; k++)
        if (p->x[k] != q->x[k])
            return p->x[k] < q->x[k] ? -1 : 1;
    return p->vertex < q->vertex ? -1 : p->vertex > q->vertex;
}

/* Vertices with equal coordinates become one. No tolerance: files that share vertices share their digits, and
 * a tolerance would fold thin parts. */
static sphm_status weld(sphm_surface *surface, sphm_context *context) {
    size_t count = surface->vertex_count, unique = 0;
    keyed_vertex *sorted = malloc(count * sizeof *sorted);
    int32_t *target = malloc(count * sizeof *target);
    if (!sorted || !target) {
        free(sorted);
        free(target);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to weld %zu vertices", count);
    }
    for (size_t v = 0; v < count; v++) {
        for (size_t k = 0; k < 3; k++)
            sorted[v].x[k] = surface->vertices[3 * v + k] + 0.0; /* turns -0 into 0 */
        sorted[v].vertex = (int32_t)v;
    }
    qsort(sorted, count, sizeof *sorted, compare_vertices);
    for (size_t v = 0; v < count; v++) {
        if (v == 0 || memcmp(sorted[v].x, &surface->vertices[3 * (unique - 1)], sizeof sorted[v].x) != 0)
            memcpy(&surface->vertices[3 * unique++], sorted[v].x, sizeof sorted[v].x);
        target[sorted[v].vertex] = (int32_t)(unique - 1);
    }
    for (size_t t = 0; t < 3 * surface->triangle_count; t++)
        surface->triangles[t] = target[surface->triangles[t]];
    surface->vertex_count = unique;
    free(sorted);
    free(target);
    return SPHM_OK;
}

static void bounding_box(const sphm_surface *surface, double lower[3], double upper[3]) {
    for (int k = 0; k < 3; k++) {
        lower[k] = INFINITY;
        upper[k] = -INFINITY;
    }
    for (size_t c = 0; c < 3 * surface->triangle_count; c++)
        for (int k = 0; k < 3; k++) {
            double x = surface->vertices[3 * (size_t)surface->triangles[c] + (size_t)k];
            lower[k] = fmin(lower[k], x);
            upper[k] = fmax(upper[k], x);
        }
}

/* Keeps the triangles whose flag is set, in their order. */
static void keep_triangles(sphm_surface *surface, const uint8_t *keep) {
    size_t kept = 0;
    for (size_t t = 0; t < surface->triangle_count; t++)
        if (keep[t])
            memmove(&surface->triangles[3 * kept++], &surface->triangles[3 * t], 3 * sizeof(int32_t));
    surface->triangle_count = kept;
}

static size_t drop_degenerate(sphm_surface *surface, uint8_t *keep) {
    double lower[3], upper[3], normal[3];
    bounding_box(surface, lower, upper);
    double negligible = 1e-14 * sphm_distance_squared3(lower, upper);
    size_t before = surface->triangle_count;
    for (size_t t = 0; t < before; t++)
        keep[t] = sphm_triangle_area_vector(surface, t, normal) > negligible;
    keep_triangles(surface, keep);
    return before - surface->triangle_count;
}

/* Connected pieces --------------------------------------------------------------------------------------- */

static int32_t find_root(int32_t *parent, int32_t v) {
    while (parent[v] != v) {
        parent[v] = parent[parent[v]];
        v = parent[v];
    }
    return v;
}

/* Pieces are joined by shared vertices. Returns how many there are and flags those worth keeping. */
static size_t find_pieces(const sphm_surface *surface, int32_t *parent, double *area, uint8_t *keep,
                          size_t *dropped) {
    double total = 0, normal[3];
    for (size_t v = 0; v < surface->vertex_count; v++) {
        parent[v] = (int32_t)v;
        area[v] = 0;
    }
    for (size_t t = 0; t < surface->triangle_count; t++)
        for (size_t k = 1; k < 3; k++) {
            int32_t a = find_root(parent, surface->triangles[3 * t]);
            int32_t b = find_root(parent, surface->triangles[3 * t + k]);
            parent[a > b ? a : b] = a < b ? a : b;
        }
    for (size_t t = 0; t < surface->triangle_count; t++) {
        double part = sphm_triangle_area_vector(surface, t, normal);
        area[find_root(parent, surface->triangles[3 * t])] += part;
        total += part;
    }
    size_t pieces = 0;
    for (size_t v = 0; v < surface->vertex_count; v++)
        if (area[v] > 0) {
            pieces++;
            *dropped += area[v] < FRAGMENT_SHARE * total;
        }
    for (size_t t = 0; t < surface->triangle_count; t++)
        keep[t] = area[find_root(parent, surface->triangles[3 * t])] >= FRAGMENT_SHARE * total;
    return pieces;
}

static sphm_status drop_fragments(sphm_surface *surface, uint8_t *keep, sphm_surface_report *report,
                                  sphm_context *context) {
    int32_t *parent = malloc(surface->vertex_count * sizeof *parent);
    double *area = malloc(surface->vertex_count * sizeof *area);
    if (!parent || !area) {
        free(parent);
        free(area);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to sort the pieces of a mesh");
    }
    report->components = find_pieces(surface, parent, area, keep, &report->dropped_fragments);
    /* A mesh of nothing but small pieces keeps them all. */
    if (report->dropped_fragments < report->components)
        keep_triangles(surface, keep);
    else
        report->dropped_fragments = 0;
    free(parent);
    free(area);
    return SPHM_OK;
}

/* Renumbers the vertices so that only those in use remain. */
static sphm_status drop_unused_vertices(sphm_surface *surface, sphm_context *context) {
    int32_t *number = malloc(surface->vertex_count * sizeof *number);
    if (!number)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to renumber a mesh");
    for (size_t v = 0; v < surface->vertex_count; v++)
        number[v] = -1;
    for (size_t c = 0; c < 3 * surface->triangle_count; c++)
        number[surface->triangles[c]] = 0;
    size_t used = 0;
    for (size_t v = 0; v < surface->vertex_count; v++)
        if (number[v] == 0) {
            memmove(&surface->vertices[3 * used], &surface->vertices[3 * v], 3 * sizeof(double));
            number[v] = (int32_t)used++;
        }
    for (size_t c = 0; c < 3 * surface->triangle_count; c++)
        surface->triangles[c] = number[surface->triangles[c]];
    surface->vertex_count = used;
    free(number);
    return SPHM_OK;
}

/* Measures ----------------------------------------------------------------------------------------------- */

static int compare_edges(const void *a, const void *b) {
    uint64_t p = *(const uint64_t *)a, q = *(const uint64_t *)b;
    return p < q ? -1 : p > q;
}

static sphm_status count_open_edges(const sphm_surface *surface, size_t *open, sphm_context *context) {
    size_t count = 3 * surface->triangle_count;
    uint64_t *edges = malloc((count ? count : 1) * sizeof *edges);
    if (!edges)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to count the edges of a mesh");
    for (size_t e = 0; e < count; e++) {
        uint64_t a = (uint64_t)surface->triangles[e];
        uint64_t b = (uint64_t)surface->triangles[e - e % 3 + (e + 1) % 3];
        edges[e] = a < b ? a << 32 | b : b << 32 | a;
    }
    qsort(edges, count, sizeof *edges, compare_edges);
    *open = 0;
    for (size_t e = 0, next; e < count; e = next) {
        for (next = e + 1; next < count && edges[next] == edges[e];)
            next++;
        *open += next == e + 1;
    }
    free(edges);
    return SPHM_OK;
}

/* Divergence theorem, V = 1/3 sum of x . A over the triangles, with x from the area's centroid: on an open
 * surface the sum depends on the point it is taken about, and there the missing area counts least. */
void sphm_surface_measure(const sphm_surface *surface, double *area_m2, double *volume_m3) {
    double centre[3] = {0, 0, 0}, total = 0, volume = 0, normal[3], x[3];
    for (int pass = 0; pass < 2; pass++)
        for (size_t t = 0; t < surface->triangle_count; t++) {
            double area = sphm_triangle_area_vector(surface, t, normal);
            for (int k = 0; k < 3; k++) {
                double sum = 0;
                for (int c = 0; c < 3; c++)
                    sum += corner(surface, t, c)[k];
                x[k] = sum / 3;
                if (pass == 0)
                    centre[k] += area * x[k];
            }
            if (pass == 0) {
                total += area;
            } else {
                for (int k = 0; k < 3; k++)
                    x[k] -= centre[k] / total;
                volume += sphm_dot3(x, normal) / 3;
            }
        }
    *area_m2 = total;
    *volume_m3 = total > 0 ? volume : 0;
}

static void turn_inside_out(sphm_surface *surface) {
    for (size_t t = 0; t < surface->triangle_count; t++) {
        int32_t swap = surface->triangles[3 * t + 1];
        surface->triangles[3 * t + 1] = surface->triangles[3 * t + 2];
        surface->triangles[3 * t + 2] = swap;
    }
}

static sphm_status measure(sphm_surface *surface, sphm_surface_report *report, sphm_context *context) {
    sphm_status status = count_open_edges(surface, &report->open_edges, context);
    if (status != SPHM_OK)
        return status;
    bounding_box(surface, report->lower_m, report->upper_m);
    sphm_surface_measure(surface, &report->area_m2, &report->volume_m3);
    if (report->volume_m3 < 0) {
        turn_inside_out(surface);
        report->volume_m3 = -report->volume_m3;
    }
    if (report->volume_m3 <= FLATNESS * pow(report->area_m2, 1.5))
        return sphm_fail(context, SPHM_REFUSED_GEOMETRY,
                         "the mesh encloses %g m3 with %g m2 of surface: it has no volume to fill; a closed "
                         "surface is needed",
                         report->volume_m3, report->area_m2);
    return SPHM_OK;
}

static sphm_status repair(sphm_surface *surface, uint8_t *keep, sphm_surface_report *report,
                          sphm_context *context) {
    sphm_status status = weld(surface, context);
    if (status != SPHM_OK)
        return status;
    report->degenerate = drop_degenerate(surface, keep);
    if (surface->triangle_count == 0)
        return sphm_fail(context, SPHM_REFUSED_GEOMETRY,
                         "all %zu triangles of the mesh are without area; a closed surface is needed",
                         report->degenerate);
    status = drop_fragments(surface, keep, report, context);
    if (status == SPHM_OK)
        status = drop_unused_vertices(surface, context);
    if (status == SPHM_OK)
        status = measure(surface, report, context);
    return status;
}

sphm_status sphm_surface_repair(sphm_surface *surface, sphm_surface_report *report, sphm_context *context) {
    sphm_surface_report found;
    sphm_surface repaired;
    memset(&found, 0, sizeof found);
    sphm_status status = check(surface, context);
    if (status != SPHM_OK)
        return status;
    /* Works on a copy: a refused surface is as it was. */
    status = sphm_surface_copy(surface, &repaired, context);
    if (status != SPHM_OK)
        return status;
    uint8_t *keep = malloc(repaired.triangle_count);
    status = keep ? repair(&repaired, keep, &found, context)
                  : sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to repair a mesh");
    free(keep);
    if (status != SPHM_OK) {
        sphm_surface_free(&repaired);
        return status;
    }
    sphm_surface_free(surface);
    *surface = repaired;
    if (report)
        *report = found;
    return SPHM_OK;
}
