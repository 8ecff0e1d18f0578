/* Messages, status names and the version. */
#include "core/context.h"

#include <stdarg.h>
#include <stdio.h>

sphm_status sphm_fail(sphm_context *context, sphm_status status, const char *format, ...) {
    if (context) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(context->message, sizeof context->message, format, arguments);
        va_end(arguments);
    }
    return status;
}

void sphm_log(sphm_context *context, sphm_log_level level, const char *format, ...) {
    if (!context || !context->log)
        return;
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    context->log(level, text, context->user);
}

const char *sphm_status_name(sphm_status status) {
    switch (status) {
    case SPHM_OK:
        return "ok";
    case SPHM_REFUSED_ARGUMENT:
        return "refused: argument";
    case SPHM_REFUSED_PARAMETER:
        return "refused: parameter";
    case SPHM_REFUSED_FILE:
        return "refused: file";
    case SPHM_REFUSED_GEOMETRY:
        return "refused: geometry";
    case SPHM_REFUSED_UNSUPPORTED:
        return "refused: not built in";
    case SPHM_REFUSED_MEMORY:
        return "refused: out of memory";
    case SPHM_FAILED_NONFINITE:
        return "failed: non-finite state";
    case SPHM_FAILED_BACKEND:
        return "failed: back end";
    }
    return "unknown status";
}

const char *sphm_version(void) {
    return SPHM_VERSION;
}

const char *sphm_build_configuration(void) {
#ifdef SPH_MUSCLE_DOUBLE
#define SPHM_PRECISION "double precision"
#else
#define SPHM_PRECISION "single precision"
#endif
#ifdef _OPENMP
#define SPHM_THREADING "OpenMP"
#else
#define SPHM_THREADING "one thread"
#endif
#ifdef SPHM_WITH_CUDA
#define SPHM_BACK_ENDS "cpu, cuda"
#else
#define SPHM_BACK_ENDS "cpu"
#endif
    return SPHM_PRECISION ", " SPHM_THREADING ", compiler " __VERSION__ ", back ends: " SPHM_BACK_ENDS;
}
