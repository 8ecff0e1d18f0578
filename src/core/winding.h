/* Generalized winding number of a triangle surface: 1 inside, 0 outside, and in between where the surface has
 * holes; and how far it is. Built once, read only afterwards, any number of threads may ask. */
#ifndef SPHM_CORE_WINDING_H
#define SPHM_CORE_WINDING_H

#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_winding sphm_winding;

/* Borrows `surface`, which must outlive the tree. */
sphm_status sphm_winding_create(const sphm_surface *surface, sphm_winding **winding, sphm_context *context);
void sphm_winding_destroy(sphm_winding *winding); /* NULL is fine */

/* By the tree: within 0.05 of the plain sum (test/winding_test.cpp), mostly within 0.01. */
double sphm_winding_number(const sphm_winding *winding, const double point[3]);
/* 1 if some triangle may be nearer to the point than `distance`; 0 if surely none is. */
int sphm_winding_near(const sphm_winding *winding, const double point[3], double distance);
/* To the nearest triangle, if that is nearer than `limit`; else `limit`. */
double sphm_winding_distance(const sphm_winding *winding, const double point[3], double limit);
/* The plain sum over all triangles, for checking. */
double sphm_winding_number_exact(const sphm_surface *surface, const double point[3]);

#ifdef __cplusplus
}
#endif
#endif
