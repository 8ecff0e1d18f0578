/* A CSV time series of observations: one header line whose names carry units, one line a sample. Every line
 * is flushed, so that a run that is cut off keeps what it had, and a plot can follow one that goes on. */
#include "core/context.h"
#include "core/number.h"
#include "sph_muscle/io.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct sphm_timeseries {
    FILE *file;
    char path[];
};

typedef struct column {
    const char *name;
    size_t offset; /* of a double inside sphm_observation */
} column;

#define COLUMN(name, field)                                                                                  \
    { name, offsetof(sphm_observation, field) }
#define REGIONS(before, field, after)                                                                        \
    COLUMN(before "_origin" after, field[0]), COLUMN(before "_centre" after, field[1]),                      \
        COLUMN(before "_insertion" after, field[2])
#define PLANES(region, index)                                                                                \
    COLUMN("displacement_" region "_xy_m", displacement_plane_m[index][0]),                                  \
        COLUMN("displacement_" region "_yz_m", displacement_plane_m[index][1]),                              \
        COLUMN("displacement_" region "_xz_m", displacement_plane_m[index][2])

static const column columns[] = {
    COLUMN("time_s", time_s),
    COLUMN("stimulus_uA_per_mm2", stimulus_uA_per_mm2),
    COLUMN("activation", activation),
    COLUMN("membrane_potential_mV", membrane_potential_mV),
    REGIONS("membrane_potential", membrane_potential_region_mV, "_mV"),
    COLUMN("displacement_mean_m", displacement_mean_m),
    COLUMN("displacement_max_m", displacement_max_m),
    REGIONS("displacement", displacement_region_m, "_m"),
    PLANES("origin", 0),
    PLANES("centre", 1),
    PLANES("insertion", 2),
    COLUMN("displacement_sections_m", displacement_sections_m),
    COLUMN("displacement_surface_m", displacement_surface_m),
    COLUMN("deformation_by_radius", deformation_by_radius),
    COLUMN("deformation_by_length", deformation_by_length),
    COLUMN("pressure_mean_Pa", pressure_mean_Pa),
    REGIONS("pressure", pressure_region_Pa, "_Pa"),
    COLUMN("electrical_pressure_mean_Pa", electrical_pressure_mean_Pa),
    COLUMN("length_m", length_m),
    COLUMN("lengthening_speed_m_per_s", lengthening_speed_m_per_s),
    COLUMN("shortening", shortening),
    COLUMN("bulge", bulge),
    COLUMN("volume_ratio", volume_ratio),
    COLUMN("kinetic_energy_J", kinetic_energy_J),
    COLUMN("speed_max_m_per_s", speed_max_m_per_s),
    COLUMN("force_N", force_N),
    COLUMN("force_active_N", force_active_N),
    COLUMN("force_passive_N", force_passive_N),
    COLUMN("force_damping_N", force_damping_N),
    COLUMN("attachment_distance_m", attachment_distance_m),
    COLUMN("normalised_fibre_length", normalised_fibre_length),
};

enum { COLUMNS = sizeof columns / sizeof columns[0] };
_Static_assert(COLUMNS * sizeof(double) + sizeof(uint64_t) == sizeof(sphm_observation),
               "a quantity of sphm_observation has no column");

static sphm_status refuse_write(const char *path, sphm_context *context) {
    return sphm_fail(context, SPHM_REFUSED_FILE, "cannot write '%s': %s", path, strerror(errno));
}

static sphm_status write_header(sphm_timeseries *series, sphm_context *context) {
    for (size_t i = 0; i < COLUMNS; i++)
        fprintf(series->file, "%s,", columns[i].name);
    if (fprintf(series->file, "nonfinite_particles,real_time_factor\n") < 0 || fflush(series->file) != 0)
        return refuse_write(series->path, context);
    return SPHM_OK;
}

sphm_status sphm_io_timeseries_open(const char *path, sphm_timeseries **series, sphm_context *context) {
    if (!path || !series)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "path or series is NULL");
    size_t size = strlen(path) + 1;
    sphm_timeseries *opened = malloc(sizeof *opened + size);
    *series = NULL;
    if (!opened)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the time series '%s'", path);
    memcpy(opened->path, path, size);
    opened->file = fopen(path, "w");
    sphm_status status = opened->file ? write_header(opened, context) : refuse_write(path, context);
    if (status == SPHM_OK) {
        *series = opened;
        return status;
    }
    if (opened->file)
        fclose(opened->file);
    free(opened);
    return status;
}

/* Ten digits: more than the particles' single precision, and times stay exact to the microsecond for hours.
 */
static void write_number(FILE *file, double value) {
    char text[SPHM_NUMBER_SIZE];
    sphm_number_print_digits(value, 10, text);
    fputs(text, file);
}

sphm_status sphm_io_timeseries_write(sphm_timeseries *series, const sphm_observation *observation,
                                     double real_time_factor, sphm_context *context) {
    if (!series || !observation)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "series or observation is NULL");
    for (size_t i = 0; i < COLUMNS; i++) {
        write_number(series->file, *(const double *)((const char *)observation + columns[i].offset));
        fputc(',', series->file);
    }
    fprintf(series->file, "%" PRIu64 ",", observation->nonfinite);
    write_number(series->file, real_time_factor);
    fputc('\n', series->file);
    if (fflush(series->file) != 0 || ferror(series->file))
        return refuse_write(series->path, context);
    return SPHM_OK;
}

sphm_status sphm_io_timeseries_close(sphm_timeseries *series, sphm_context *context) {
    if (!series)
        return SPHM_OK;
    sphm_status status = fclose(series->file) == 0 ? SPHM_OK : refuse_write(series->path, context);
    free(series);
    return status;
}
