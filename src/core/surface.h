/* What the geometry stage shares about triangle surfaces (the public part is sph_muscle/geometry.h). */
#ifndef SPHM_CORE_SURFACE_H
#define SPHM_CORE_SURFACE_H

#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Room for a surface, uninitialised; zeroed when refused. */
sphm_status sphm_surface_allocate(sphm_surface *surface, size_t vertices, size_t triangles,
                                  sphm_context *context);
/* Area times outward normal; returns the area. */
double sphm_triangle_area_vector(const sphm_surface *surface, size_t triangle, double out[3]);
/* Area, and volume with its sign: negative when the surface is inside out. */
void sphm_surface_measure(const sphm_surface *surface, double *area_m2, double *volume_m3);

#ifdef __cplusplus
}
#endif
#endif
