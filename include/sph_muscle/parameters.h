/* Parameters: one struct, generated from parameter_list.inc, and access to it by name.
 *
 * Start from sphm_parameters_default(); a merely zeroed struct is refused wherever parameters are taken,
 * and the muscle keeps a copy, so later changes have no effect on it. */
#ifndef SPH_MUSCLE_PARAMETERS_H
#define SPH_MUSCLE_PARAMETERS_H

#include "sph_muscle/types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SPHM_TEXT_SIZE 1024
/* A vector component with this value is "automatic"; written `auto` in files. */
#define SPHM_AUTO 1e300

/* Indices of the choices, in the order of parameter_list.inc (checked when the library is compiled). */
enum { SPHM_TISSUE_FLUID, SPHM_TISSUE_SOLID };
enum { SPHM_BACKEND_AUTO, SPHM_BACKEND_CPU, SPHM_BACKEND_CUDA };
enum { SPHM_PRESET_TRICEPS_LONG_HEAD, SPHM_PRESET_VASTUS_LATERALIS, SPHM_PRESET_BELLY, SPHM_PRESET_BAR };
enum { SPHM_FIBRES_PARALLEL, SPHM_FIBRES_PENNATE, SPHM_FIBRES_FILE, SPHM_FIBRES_LAPLACE };
enum { SPHM_LAPLACIAN_CORRECTED, SPHM_LAPLACIAN_BROOKSHAW, SPHM_LAPLACIAN_PAPER };
enum { SPHM_COUPLING_PRESSURE, SPHM_COUPLING_FIBRE_TENSION };
enum { SPHM_FIBRE_TRUE_STRETCH, SPHM_FIBRE_VOLUME_FREE };
enum { SPHM_END_ORIENTATION_FRAME, SPHM_END_ORIENTATION_LINE };
enum { SPHM_FORCE_VELOCITY_OFF, SPHM_FORCE_VELOCITY_HILL };
enum { SPHM_TENDON_INSERTION, SPHM_TENDON_ORIGIN, SPHM_TENDON_BOTH };
enum { SPHM_TIME_STEP_REDUCE, SPHM_TIME_STEP_REFUSE };
/* Electrodes: the choice `electrode` and the ELECTRODE of a schedule. */
enum {
    SPHM_ELECTRODE_BELLY,
    SPHM_ELECTRODE_ORIGIN,
    SPHM_ELECTRODE_INSERTION,
    SPHM_ELECTRODE_BOTH,
    SPHM_ELECTRODE_SPHERE,
    SPHM_ELECTRODE_COUNT
};
enum {
    SPHM_FIELD_DISPLACEMENT,
    SPHM_FIELD_PRESSURE,
    SPHM_FIELD_MEMBRANE_POTENTIAL,
    SPHM_FIELD_ACTIVATION,
    SPHM_FIELD_FIBRE_STRETCH,
    SPHM_FIELD_COUNT
};

typedef struct sphm_parameters {
    uint32_t marker; /* set by sphm_parameters_default() */
#define GROUP(title, help)
#define REAL(name, unit, value, minimum, maximum, help) double name;
#define INTEGER(name, unit, value, minimum, maximum, help) int64_t name;
#define BOOLEAN(name, value, help) int name;
#define CHOICE(name, value, choices, help) int name;
#define TEXT(name, value, help) char name[SPHM_TEXT_SIZE];
#define VECTOR(name, unit, x, y, z, minimum, maximum, help) double name[3];
#include "sph_muscle/parameter_list.inc"
#undef GROUP
#undef REAL
#undef INTEGER
#undef BOOLEAN
#undef CHOICE
#undef TEXT
#undef VECTOR
} sphm_parameters;

typedef enum sphm_parameter_kind {
    SPHM_KIND_REAL,
    SPHM_KIND_INTEGER,
    SPHM_KIND_BOOLEAN,
    SPHM_KIND_CHOICE,
    SPHM_KIND_TEXT,
    SPHM_KIND_VECTOR
} sphm_parameter_kind;

/* One row of the table. Strings live as long as the library. */
typedef struct sphm_parameter_info {
    const char *name, *unit, *help, *group, *choices; /* choices: "a|b|c", else NULL */
    sphm_parameter_kind kind;
    double minimum, maximum;  /* real, integer, vector components */
    const char *default_text; /* as it would be written in a file */
    size_t offset;            /* of the value inside sphm_parameters */
} sphm_parameter_info;

sphm_parameters sphm_parameters_default(void);

/* The table: rows 0 ... sphm_parameter_count() - 1 in the order of the list. NULL beyond it. */
size_t sphm_parameter_count(void);
const sphm_parameter_info *sphm_parameter_row(size_t row);
/* The row called `name`, or NULL. */
const sphm_parameter_info *sphm_parameter_find(const char *name);

/* Sets one parameter from text ("2231", "auto", "[0, 0, -9.81]", "true", "fluid"). Refuses an unknown name
 * (suggesting the nearest one), text of the wrong type, non-finite numbers and values out of range; the
 * message gives name, value and range. Locale-independent. */
sphm_status sphm_parameters_set(sphm_parameters *parameters, const char *name, const char *value,
                                sphm_context *context);
/* Writes the present value as text that sphm_parameters_set() reads back to the same value. */
sphm_status sphm_parameters_get(const sphm_parameters *parameters, const char *name, char *text, size_t size,
                                sphm_context *context);
/* Checks every value against its range and the rules between parameters (Vr < Vth < Vp, fibre_file given
 * when fibres is file, ...). Called by sphm_muscle_create(). */
sphm_status sphm_parameters_check(const sphm_parameters *parameters, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
