/* Status codes, messages and the few plain types every other header uses.
 *
 * Units: SI throughout, except membrane potentials (mV), stimulus currents (uA/mm2) and the
 * electrophysiological constants, whose names say so. Vectors are x, y, z. */
#ifndef SPH_MUSCLE_TYPES_H
#define SPH_MUSCLE_TYPES_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Precision of particle arrays and of the physics at a point; sums over particles are always double. */
#ifdef SPH_MUSCLE_DOUBLE
typedef double sphm_real;
#else
typedef float sphm_real;
#endif

/* What a fallible call returns. Zero: done. Positive: refused, and every object is as it was before the
 * call. Negative: the object failed and must be reset, restored or destroyed before it is stepped again. */
typedef enum sphm_status {
    SPHM_OK = 0,
    SPHM_REFUSED_ARGUMENT = 1,    /* a value passed to the call is not usable */
    SPHM_REFUSED_PARAMETER = 2,   /* unknown name, wrong type or out of range */
    SPHM_REFUSED_FILE = 3,        /* missing, unreadable, truncated or foreign file */
    SPHM_REFUSED_GEOMETRY = 4,    /* empty mesh, no volume, particle count that cannot be met */
    SPHM_REFUSED_UNSUPPORTED = 5, /* known, but not built into this library */
    SPHM_REFUSED_MEMORY = 6,      /* allocation failed */
    SPHM_FAILED_NONFINITE = -1,   /* the state holds a NaN or an infinity, or ran away */
    SPHM_FAILED_BACKEND = -2      /* the back end stopped working */
} sphm_status;

typedef enum sphm_log_level { SPHM_LOG_INFO = 0, SPHM_LOG_WARNING = 1 } sphm_log_level;

/* Where messages go. The caller owns it and passes it to every fallible call; NULL is allowed and drops
 * them. After a call that did not return SPHM_OK, `message` names the offending value and what would be
 * valid. `log` (may be NULL) receives notes and warnings of calls that succeed. One context must not be
 * used by two threads at a time. */
typedef struct sphm_context {
    char message[1024];
    void (*log)(sphm_log_level level, const char *text, void *user);
    void *user;
} sphm_context;

/* A short fixed name of a status, e.g. "refused: parameter". Never NULL. */
const char *sphm_status_name(sphm_status status);

/* Version as "major.minor.patch", and how the library was built (precision, compiler, back ends). */
const char *sphm_version(void);
const char *sphm_build_configuration(void);

#ifdef __cplusplus
}
#endif
#endif
