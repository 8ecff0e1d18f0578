/* From parameters to the constants of the solid tissue's kernels. */
#ifndef SPHM_CORE_SOLID_CONSTANTS_H
#define SPHM_CORE_SOLID_CONSTANTS_H

#include "kernels/solid.h"

#ifdef __cplusplus
extern "C" {
#endif

sphm_solid_constants sphm_solid_constants_from(const sphm_parameters *parameters);

#ifdef __cplusplus
}
#endif
#endif
