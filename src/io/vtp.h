/* VTK's XML PolyData format: a short XML head, then all arrays as raw binary. */
#ifndef SPHM_IO_VTP_H
#define SPHM_IO_VTP_H

#include "sph_muscle/types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum sphm_vtp_type { SPHM_VTP_FLOAT32, SPHM_VTP_UINT8, SPHM_VTP_INT32, SPHM_VTP_INT64 } sphm_vtp_type;

/* Where an array belongs. A file has one POINTS array; cells are vertices or triangles. */
typedef enum sphm_vtp_section {
    SPHM_VTP_POINTS,
    SPHM_VTP_POINT_DATA,
    SPHM_VTP_VERTICES, /* connectivity, then offsets */
    SPHM_VTP_TRIANGLES
} sphm_vtp_section;

typedef struct sphm_vtp_array {
    sphm_vtp_section section;
    const char *name;
    sphm_vtp_type type;
    int components;
    size_t tuples;
    const void *data; /* [components * tuples], borrowed; NULL (INT64 only): first, first + stride, ... */
    int64_t first, stride;
} sphm_vtp_array;

/* Writes `count` arrays, grouped by section in the order of sphm_vtp_section. A file that could not be
 * written whole is removed. */
sphm_status sphm_vtp_write(const char *path, double time_s, const sphm_vtp_array *arrays, size_t count,
                           sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
