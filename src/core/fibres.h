/* Fibre directions of a body. */
#ifndef SPHM_CORE_FIBRES_H
#define SPHM_CORE_FIBRES_H

#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes body->fibres as parameters->fibres says; reads the rest of the body but `surface` and `isolated`. */
sphm_status sphm_body_lay_fibres(sphm_body *body, const sphm_parameters *parameters, sphm_context *context);

/* The parts of it that have files of their own: laplace.c and fibre_file.c. */
sphm_status sphm_body_lay_laplace(sphm_body *body, int64_t threads, sphm_context *context);
sphm_status sphm_body_lay_file(sphm_body *body, const char *path, int64_t threads, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
