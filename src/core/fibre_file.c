/* Fibre directions from a text file of lines "x y z dx dy dz" in metres; # starts a comment. Reads the file
 * and the particles' positions, writes directions: those of the nearest point. */
#include "core/context.h"
#include "core/fibres.h"
#include "core/number.h"
#include "core/point_grid.h"
#include "core/threads.h"
#include "core/vec3.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_SIZE 1024

typedef struct samples {
    size_t count, capacity;
    double *points, *directions; /* [3 * count] */
} samples;

static void samples_free(samples *s) {
    free(s->points);
    free(s->directions);
}

static int reserve(samples *s) {
    if (s->count < s->capacity)
        return 1;
    size_t capacity = s->capacity ? 2 * s->capacity : 1024;
    double *points = realloc(s->points, 3 * capacity * sizeof *points);
    if (!points)
        return 0;
    s->points = points;
    double *directions = realloc(s->directions, 3 * capacity * sizeof *directions);
    if (!directions)
        return 0;
    s->directions = directions;
    s->capacity = capacity;
    return 1;
}

/* Six numbers into a sample; blank lines and comments are no samples. */
static sphm_status read_line(char *line, const char *path, size_t number, samples *s, sphm_context *context) {
    double value[6];
    size_t words = 0;
    char *comment = strchr(line, '#'), *rest = NULL;
    if (comment)
        *comment = '\0';
    for (char *word = strtok_r(line, " \t\r\n", &rest); word;
         word = strtok_r(NULL, " \t\r\n", &rest), words++)
        if (words < 6 && !sphm_number_parse(word, &value[words]))
            return sphm_fail(
                context, SPHM_REFUSED_FILE,
                "fibre_file: %s, line %zu: '%.40s' is no finite number; a line is 'x y z dx dy dz'", path,
                number, word);
    if (words == 0)
        return SPHM_OK;
    if (words != 6)
        return sphm_fail(context, SPHM_REFUSED_FILE,
                         "fibre_file: %s, line %zu has %zu numbers; a line is 'x y z dx dy dz'", path, number,
                         words);
    if (!(sphm_normalise3(value + 3) > 0))
        return sphm_fail(context, SPHM_REFUSED_FILE,
                         "fibre_file: %s, line %zu: the direction is 0 0 0; it must have a length", path,
                         number);
    if (!reserve(s))
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the fibres of %s", path);
    memcpy(&s->points[3 * s->count], value, 3 * sizeof *value);
    memcpy(&s->directions[3 * s->count++], value + 3, 3 * sizeof *value);
    return SPHM_OK;
}

static sphm_status read_lines(FILE *file, const char *path, samples *s, sphm_context *context) {
    char line[LINE_SIZE];
    for (size_t number = 1; fgets(line, sizeof line, file); number++) {
        if (!strchr(line, '\n') && strlen(line) == sizeof line - 1)
            return sphm_fail(
                context, SPHM_REFUSED_FILE,
                "fibre_file: %s, line %zu is longer than %d characters; a line is 'x y z dx dy dz'", path,
                number, LINE_SIZE - 2);
        sphm_status status = read_line(line, path, number, s, context);
        if (status != SPHM_OK)
            return status;
    }
    if (ferror(file))
        return sphm_fail(context, SPHM_REFUSED_FILE, "fibre_file: %s cannot be read: %s", path,
                         strerror(errno));
    if (s->count == 0)
        return sphm_fail(context, SPHM_REFUSED_FILE,
                         "fibre_file: %s holds no fibres; lines 'x y z dx dy dz' are needed", path);
    return SPHM_OK;
}

static sphm_status read_file(const char *path, samples *s, sphm_context *context) {
    FILE *file = fopen(path, "r");
    if (!file)
        return sphm_fail(context, SPHM_REFUSED_FILE, "fibre_file: %s cannot be opened: %s", path,
                         strerror(errno));
    sphm_status status = read_lines(file, path, s, context);
    fclose(file);
    return status;
}

/* A cell edge at which a cell of the samples' box holds about two of them. */
static double cell_for(const samples *s) {
    double lower[3], upper[3], longest = 0, volume = 1;
    for (size_t k = 0; k < 3; k++) {
        lower[k] = upper[k] = s->points[k];
        for (size_t p = 1; p < s->count; p++) {
            lower[k] = fmin(lower[k], s->points[3 * p + k]);
            upper[k] = fmax(upper[k], s->points[3 * p + k]);
        }
        longest = fmax(longest, upper[k] - lower[k]);
    }
    if (!(longest > 0))
        return 1;
    /* Flat and thread-like sets are given some thickness. */
    for (int k = 0; k < 3; k++)
        volume *= fmax(upper[k] - lower[k], 0.01 * longest);
    return cbrt(2 * volume / (double)s->count);
}

static sphm_status copy_nearest(sphm_body *body, const samples *s, int64_t threads, sphm_context *context) {
    sphm_point_grid grid;
    sphm_status status = sphm_point_grid_create(s->points, s->count, cell_for(s), &grid, context);
    if (status != SPHM_OK)
        return status;
    const int64_t count = (int64_t)body->count;
#pragma omp parallel for schedule(dynamic, 256) num_threads(sphm_team_size(threads))
    for (int64_t p = 0; p < count; p++)
        memcpy(&body->fibres[3 * p],
               &s->directions[3 * sphm_point_grid_nearest(&grid, &body->positions[3 * p])],
               3 * sizeof(double));
    sphm_point_grid_free(&grid);
    return SPHM_OK;
}

sphm_status sphm_body_lay_file(sphm_body *body, const char *path, int64_t threads, sphm_context *context) {
    samples s;
    memset(&s, 0, sizeof s);
    sphm_status status = read_file(path, &s, context);
    if (status == SPHM_OK)
        status = copy_nearest(body, &s, threads, context);
    samples_free(&s);
    return status;
}
