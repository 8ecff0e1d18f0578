/* Whole files: read into memory, or replaced in one go. */
#ifndef SPHM_CORE_FILE_BYTES_H
#define SPHM_CORE_FILE_BYTES_H

#include "sph_muscle/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes a temporary file beside `path`, brings it to the disk and renames it: whoever looks sees the old
 * file or the whole new one, also after a crash. */
sphm_status sphm_file_replace(const char *path, const void *data, size_t size, sphm_context *context);
/* *data is the caller's to free. Refuses what is missing, unreadable or no regular file. */
sphm_status sphm_file_read(const char *path, unsigned char **data, size_t *size, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
