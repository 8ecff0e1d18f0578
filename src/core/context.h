/* Filling a caller's context with messages. */
#ifndef SPHM_CORE_CONTEXT_H
#define SPHM_CORE_CONTEXT_H

#include "sph_muscle/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Stores the formatted message (if there is a context) and returns `status`, so that a refusal is one line:
 *     return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "radius is %g m; it must be above 0", radius); */
sphm_status sphm_fail(sphm_context *context, sphm_status status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* Hands a note or a warning to context->log, if there is one. */
void sphm_log(sphm_context *context, sphm_log_level level, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#ifdef __cplusplus
}
#endif
#endif
