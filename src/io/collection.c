/* A .pvd file: the VTK files of an animation with their times. */
#include "core/context.h"
#include "core/number.h"
#include "sph_muscle/io.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct sphm_collection {
    FILE *file;
    long end; /* where the closing tags are, and the next entry goes */
    char path[];
};

static sphm_status refuse_write(const sphm_collection *c, sphm_context *context) {
    return sphm_fail(context, SPHM_REFUSED_FILE, "cannot write '%s': %s", c->path, strerror(errno));
}

/* The closing tags are written after every entry and written over by the next one. */
static sphm_status write_tail(sphm_collection *c, sphm_context *context) {
    c->end = ftell(c->file);
    fputs("  </Collection>\n</VTKFile>\n", c->file);
    if (c->end < 0 || fflush(c->file) != 0 || ferror(c->file))
        return refuse_write(c, context);
    return SPHM_OK;
}

sphm_status sphm_io_collection_open(const char *path, sphm_collection **collection, sphm_context *context) {
    if (!path || !collection)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "path or collection is NULL");
    *collection = NULL;
    size_t size = strlen(path) + 1;
    sphm_collection *c = malloc(sizeof *c + size);
    if (!c)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the collection '%s'", path);
    memcpy(c->path, path, size);
    c->file = fopen(path, "w");
    sphm_status status = SPHM_OK;
    if (c->file) {
        fputs("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\">\n  <Collection>\n",
              c->file);
        status = write_tail(c, context);
    } else
        status = refuse_write(c, context);
    if (status == SPHM_OK) {
        *collection = c;
        return status;
    }
    if (c->file)
        fclose(c->file);
    free(c);
    return status;
}

static void write_escaped(FILE *file, const char *text) {
    for (; *text; text++) {
        if (*text == '&')
            fputs("&amp;", file);
        else if (*text == '<')
            fputs("&lt;", file);
        else if (*text == '"')
            fputs("&quot;", file);
        else
            fputc(*text, file);
    }
}

sphm_status sphm_io_collection_add(sphm_collection *c, double time_s, const char *file,
                                   sphm_context *context) {
    if (!c || !file)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "collection or file is NULL");
    char time[SPHM_NUMBER_SIZE];
    sphm_number_print_digits(time_s, 10, time);
    if (fseek(c->file, c->end, SEEK_SET) != 0)
        return refuse_write(c, context);
    fprintf(c->file, "    <DataSet timestep=\"%s\" part=\"0\" file=\"", time);
    write_escaped(c->file, file);
    fputs("\"/>\n", c->file);
    return write_tail(c, context);
}

sphm_status sphm_io_collection_close(sphm_collection *c, sphm_context *context) {
    if (!c)
        return SPHM_OK;
    sphm_status status = fclose(c->file) == 0 ? SPHM_OK : refuse_write(c, context);
    free(c);
    return status;
}
