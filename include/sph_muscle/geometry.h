/* Geometry: a closed-ish triangle surface, filled with particles, with a line of action, fibres,
 * attachments and regions (design: sections 3.5, 3.9 and 3.10 of the paper). Lengths in metres. */
#ifndef SPH_MUSCLE_GEOMETRY_H
#define SPH_MUSCLE_GEOMETRY_H

#include "sph_muscle/parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How far behind the last layer that is held the solid tissue feels its clamp, in layers (doc/solid.md,
 * "Where an end is held"). */
#define SPHM_CLAMP_DEPTH 0.4

/* A triangle surface. Whoever fills the struct owns it and frees it with sphm_surface_free(). */
typedef struct sphm_surface {
    size_t vertex_count, triangle_count;
    double *vertices;   /* [3 * vertex_count], m */
    int32_t *triangles; /* [3 * triangle_count], vertex numbers, counter-clockwise seen from outside */
} sphm_surface;

/* What was found in a surface and done about it. */
typedef struct sphm_surface_report {
    size_t open_edges;        /* edges with one triangle, in the part that is kept */
    size_t components;        /* connected pieces after welding */
    size_t dropped_fragments; /* pieces left out: less than 1 % of the total area */
    size_t degenerate;        /* triangles without area, left out */
    double area_m2, volume_m3;
    double lower_m[3], upper_m[3]; /* bounding box */
} sphm_surface_report;

void sphm_surface_free(sphm_surface *surface);
sphm_status sphm_surface_copy(const sphm_surface *from, sphm_surface *to, sphm_context *context);
/* Welds equal vertices, drops degenerate triangles and loose fragments, turns the surface outwards if its
 * volume is negative. Refuses an empty surface and one without volume. `report` may be NULL. */
sphm_status sphm_surface_repair(sphm_surface *surface, sphm_surface_report *report, sphm_context *context);
/* The surface of the preset named by parameters->preset, in its frame: x from origin to insertion, y the
 * widest direction, centred on the line of action. */
sphm_status sphm_surface_preset(const sphm_parameters *parameters, sphm_surface *surface,
                                sphm_context *context);

enum { SPHM_FREE = 0, SPHM_ATTACHED_ORIGIN = 1, SPHM_ATTACHED_INSERTION = 2 };
enum { SPHM_REGION_ORIGIN = 0, SPHM_REGION_CENTRE = 1, SPHM_REGION_INSERTION = 2, SPHM_REGION_COUNT = 3 };

/* The muscle's rest shape as particles. Arrays are by particle id, 0 ... count - 1. */
typedef struct sphm_body {
    size_t count;
    double spacing_m;    /* of the filling, cube root of a cell */
    double step_m[3][3]; /* of the filling's lattice: from a site to the next in its directions, a row each */
    double layer_m; /* what a step is along the line of action; of a tilted line sqrt(sum (step . axis)^2) */
    double volume_m3;
    double support_radius_m; /* h */
    double length_m;         /* |insertion - origin| */
    double mid_radius_m;     /* equivalent radius sqrt(A/pi) of the mid-belly section */
    /* Line of action and its unit vector. Of a mesh, unless given, the principal axis of a fine filling, cut
     * half a cube beyond the outermost: the number of particles has no say in it. */
    double origin_m[3], insertion_m[3], axis[3];
    /* Of the solid tissue: the sections across the line of action beyond which attachment_fraction of the
     * volume lies, [0] at the origin and [1] at the insertion; x . axis, m. The tissue behaves as if clamped
     * in them, though it is held up to SPHM_CLAMP_DEPTH layers inside. A bar's layers do not follow them: it
     * is clamped up to half a layer beside them. Of a surface with holes they are found on that filling. Both
     * 0 where nothing is attached, and of the fluid. */
    double clamp_m[2];
    double lower_m[3], upper_m[3];
    double *positions; /* [3 * count], m */
    /* [count], m3; sums to volume_m3. Of the solid tissue what lies nearer to the particle than to any other
     * (0.3 to 1.7 times the mean at a surface); of the fluid, and of a bar without jitter, all the same. */
    double *volumes;
    double *fibres;         /* [3 * count], unit vectors */
    double *axial_fraction; /* [count], 0 ... 1: share of the tissue nearer to the origin, by volume */
    uint8_t *attachment;    /* [count], SPHM_FREE ... */
    uint8_t *region;        /* [count], SPHM_REGION_...: 20 % / 60 % / 20 % by volume */
    uint8_t *outer;         /* [count], 1 on the outermost layer of particles */
    size_t isolated;        /* particles with no neighbour within h */
    sphm_surface surface;   /* what was filled, repaired */
    sphm_surface_report report;
} sphm_body;

/* Builds the rest shape from `mesh` (borrowed; NULL: the preset) and the parameters. On anything but
 * SPHM_OK `body` is left zeroed. */
sphm_status sphm_body_create(const sphm_parameters *parameters, const sphm_surface *mesh, sphm_body *body,
                             sphm_context *context);
void sphm_body_free(sphm_body *body);

#ifdef __cplusplus
}
#endif
#endif
