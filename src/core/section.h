/* Sections across a direction that cut a share of the volume off. */
#ifndef SPHM_CORE_SECTION_H
#define SPHM_CORE_SECTION_H

#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What is cut. A closed surface without overlapping parts is cut exactly; one with holes has no volume of its
 * own, and what it was filled with is cut in its stead: cells about `points`, `layer_m` thick along the
 * direction. */
typedef struct sphm_cut_body {
    const sphm_surface *surface; /* closed, or NULL */
    const double *points;        /* [3 * count], m; not read where there is a surface */
    size_t count;
    double layer_m;
} sphm_cut_body;

/* Volume where x . axis < at_m, over the whole. `axis` is a unit vector. */
double sphm_share_below(const sphm_cut_body *body, const double axis[3], double at_m);
/* The two sections (x . axis, m) beyond which `share` (above 0, at most 1/2) of the volume lies at the lower
 * and at the upper end. */
void sphm_end_sections(const sphm_cut_body *body, const double axis[3], double share, double sections_m[2]);

#ifdef __cplusplus
}
#endif
#endif
