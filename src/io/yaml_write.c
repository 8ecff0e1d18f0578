/* Parameters as a YAML file: what a run was computed with, ready to run again. Scalars and one list level
 * need no emitter, so that this works in a build without libyaml. */
#define _XOPEN_SOURCE 700 /* realpath */
#include "core/context.h"
#include "sph_muscle/io.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Double quotes with the escapes YAML and JSON share. */
static void write_quoted(FILE *file, const char *text) {
    fputc('"', file);
    for (const unsigned char *c = (const unsigned char *)text; *c; c++) {
        if (*c == '"' || *c == '\\')
            fprintf(file, "\\%c", *c);
        else if (*c < 0x20 || *c == 0x7f)
            fprintf(file, "\\x%02x", *c);
        else
            fputc(*c, file);
    }
    fputc('"', file);
}

/* YAML 1.1 readers (rosparam among them) take 1e-05 for text; 1.0e-05 is a number to all of them. */
static void write_numbers(FILE *file, const char *text) {
    int has_point = 0;
    for (; *text; text++) {
        if (*text == 'e' && !has_point)
            fputs(".0", file);
        has_point = *text == '.' || (has_point && *text != ',');
        fputc(*text, file);
    }
}

static void write_text(FILE *file, const sphm_parameter_info *row, const char *text) {
    int is_path = strcmp(row->name, "mesh") == 0 || strcmp(row->name, "fibre_file") == 0;
    char *absolute = is_path && text[0] ? realpath(text, NULL) : NULL;
    write_quoted(file, absolute ? absolute : text);
    free(absolute);
}

static sphm_status write_row(FILE *file, const sphm_parameter_info *row, const sphm_parameters *parameters,
                             sphm_context *context) {
    char text[SPHM_TEXT_SIZE];
    sphm_status status = sphm_parameters_get(parameters, row->name, text, sizeof text, context);
    if (status != SPHM_OK)
        return status;
    fprintf(file, "%s: ", row->name);
    if (row->kind == SPHM_KIND_TEXT)
        write_text(file, row, text);
    else if (row->kind == SPHM_KIND_REAL || row->kind == SPHM_KIND_VECTOR)
        write_numbers(file, text);
    else
        fputs(text, file);
    fprintf(file, "  # %s%s%s\n", row->unit, row->unit[0] ? "; " : "", row->help);
    return SPHM_OK;
}

static sphm_status write_all(FILE *file, const sphm_parameters *parameters, sphm_context *context) {
    const char *group = "";
    fprintf(file, "# sph_muscle %s, %s\n", sphm_version(), sphm_build_configuration());
    for (size_t i = 0; i < sphm_parameter_count(); i++) {
        const sphm_parameter_info *row = sphm_parameter_row(i);
        if (strcmp(row->group, group) != 0)
            fprintf(file, "\n# %s\n", row->group);
        group = row->group;
        sphm_status status = write_row(file, row, parameters, context);
        if (status != SPHM_OK)
            return status;
    }
    return SPHM_OK;
}

sphm_status sphm_io_save_parameters(const sphm_parameters *parameters, const char *path,
                                    sphm_context *context) {
    if (!path || !parameters)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "path or parameters are NULL");
    FILE *file = fopen(path, "w");
    if (!file)
        return sphm_fail(context, SPHM_REFUSED_FILE, "cannot write '%s': %s", path, strerror(errno));
    sphm_status status = write_all(file, parameters, context);
    int failed = ferror(file);
    failed |= fclose(file);
    if (status == SPHM_OK && failed)
        status = sphm_fail(context, SPHM_REFUSED_FILE, "cannot write '%s': %s", path, strerror(errno));
    return status;
}
