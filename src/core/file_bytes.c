/* Reading and replacing whole files (POSIX). */
#define _POSIX_C_SOURCE 200809L
#include "core/file_bytes.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/context.h"

static int write_all(int file, const unsigned char *data, size_t size) {
    while (size > 0) {
        const ssize_t written = write(file, data, size);
        if (written < 0 && errno == EINTR)
            continue;
        if (written <= 0)
            return 0;
        data += written;
        size -= (size_t)written;
    }
    return 1;
}

/* The name of a file becomes durable with its folder. Not every file system can: that is no failure. */
static void sync_folder(const char *path) {
    char *folder = strdup(path);
    if (!folder)
        return;
    char *slash = strrchr(folder, '/');
    if (slash)
        slash[slash == folder] = 0;
    const int file = open(slash ? folder : ".", O_RDONLY);
    if (file >= 0) {
        (void)fsync(file);
        (void)close(file);
    }
    free(folder);
}

sphm_status sphm_file_replace(const char *path, const void *data, size_t size, sphm_context *context) {
    const size_t length = strlen(path) + 8;
    char *temporary = malloc(length);
    if (!temporary)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to write '%s'", path);
    snprintf(temporary, length, "%s.XXXXXX", path);
    const int file = mkstemp(temporary);
    if (file < 0) {
        const int error = errno;
        free(temporary);
        return sphm_fail(context, SPHM_REFUSED_FILE,
                         "cannot write '%s': %s; its folder must exist and be writable", path,
                         strerror(error));
    }
    int good = fchmod(file, 0644) == 0 && write_all(file, data, size) && fsync(file) == 0;
    int error = errno;
    if (close(file) != 0 && good) {
        good = 0;
        error = errno;
    }
    if (good && rename(temporary, path) != 0) {
        good = 0;
        error = errno;
    }
    if (!good)
        (void)unlink(temporary);
    free(temporary);
    if (!good)
        return sphm_fail(context, SPHM_REFUSED_FILE, "cannot write '%s': %s", path, strerror(error));
    sync_folder(path);
    return SPHM_OK;
}

static sphm_status read_open(FILE *file, const char *path, unsigned char **data, size_t *size,
                             sphm_context *context) {
    struct stat about;
    if (fstat(fileno(file), &about) != 0 || !S_ISREG(about.st_mode))
        return sphm_fail(context, SPHM_REFUSED_FILE, "'%s' is not a regular file", path);
    const size_t expected = (size_t)about.st_size;
    *data = malloc(expected + 1);
    if (!*data)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to read '%s' (%zu bytes)", path, expected);
    *size = fread(*data, 1, expected, file);
    if (*size == expected)
        return SPHM_OK;
    free(*data);
    *data = NULL;
    return sphm_fail(context, SPHM_REFUSED_FILE, "cannot read '%s': %zu of %zu bytes came", path, *size,
                     expected);
}

sphm_status sphm_file_read(const char *path, unsigned char **data, size_t *size, sphm_context *context) {
    *data = NULL;
    *size = 0;
    const int opened = open(path, O_RDONLY | O_NONBLOCK); /* a pipe must not hold the muscle up */
    FILE *file = opened < 0 ? NULL : fdopen(opened, "rb");
    if (!file) {
        const int error = errno;
        if (opened >= 0)
            (void)close(opened);
        return sphm_fail(context, SPHM_REFUSED_FILE, "cannot read '%s': %s", path, strerror(error));
    }
    const sphm_status status = read_open(file, path, data, size, context);
    fclose(file);
    return status;
}
