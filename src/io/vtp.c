/* Writes .vtp files. Raw appended data is what ParaView reads fastest and takes no base64 code of ours; the
 * VTK library itself would be a dependency of hundreds of megabytes for this page. */
#define _POSIX_C_SOURCE 200809L /* fstat, fileno */
#include "io/vtp.h"

#include "core/context.h"
#include "core/number.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

static const char *type_name(sphm_vtp_type type) {
    static const char *const names[] = {"Float32", "UInt8", "Int32", "Int64"};
    return names[type];
}

static uint64_t byte_count(const sphm_vtp_array *array) {
    static const uint64_t sizes[] = {4, 1, 4, 8};
    return sizes[array->type] * (uint64_t)array->components * array->tuples;
}

static const char *byte_order(void) {
    const uint16_t one = 1;
    return *(const unsigned char *)&one ? "LittleEndian" : "BigEndian";
}

static size_t tuples_in(const sphm_vtp_array *arrays, size_t count, sphm_vtp_section section) {
    for (size_t i = 0; i < count; i++)
        if (arrays[i].section == section)
            return arrays[i].tuples;
    return 0;
}

/* The <DataArray> lines of a section, each with the place of its bytes after the '_' that starts them. */
static void write_section(FILE *file, const char *element, sphm_vtp_section section,
                          const sphm_vtp_array *arrays, size_t count, uint64_t *offset) {
    fprintf(file, "      <%s>\n", element);
    for (size_t i = 0; i < count; i++) {
        if (arrays[i].section != section)
            continue;
        fprintf(file,
                "        <DataArray type=\"%s\" Name=\"%s\" NumberOfComponents=\"%d\" format=\"appended\" "
                "offset=\"%" PRIu64 "\"/>\n",
                type_name(arrays[i].type), arrays[i].name, arrays[i].components, *offset);
        *offset += sizeof(uint64_t) + byte_count(&arrays[i]);
    }
    fprintf(file, "      </%s>\n", element);
}

static void write_head(FILE *file, double time_s, const sphm_vtp_array *arrays, size_t count) {
    char time[SPHM_NUMBER_SIZE];
    uint64_t offset = 0;
    sphm_number_print(time_s, time);
    fprintf(
        file,
        "<?xml version=\"1.0\"?>\n"
        "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"%s\" header_type=\"UInt64\">\n"
        "  <PolyData>\n"
        "    <FieldData>\n"
        "      <DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">%s"
        "</DataArray>\n"
        "    </FieldData>\n"
        "    <Piece NumberOfPoints=\"%zu\" NumberOfVerts=\"%zu\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
        "NumberOfPolys=\"%zu\">\n",
        byte_order(), time, tuples_in(arrays, count, SPHM_VTP_POINTS),
        tuples_in(arrays, count, SPHM_VTP_VERTICES), tuples_in(arrays, count, SPHM_VTP_TRIANGLES) / 3);
    write_section(file, "Points", SPHM_VTP_POINTS, arrays, count, &offset);
    write_section(file, "PointData", SPHM_VTP_POINT_DATA, arrays, count, &offset);
    write_section(file, "Verts", SPHM_VTP_VERTICES, arrays, count, &offset);
    write_section(file, "Polys", SPHM_VTP_TRIANGLES, arrays, count, &offset);
    fprintf(file, "    </Piece>\n  </PolyData>\n  <AppendedData encoding=\"raw\">\n_");
}

static void write_ramp(FILE *file, const sphm_vtp_array *array) {
    int64_t block[512], value = array->first;
    for (size_t left = array->tuples; left;) {
        size_t n = left < 512 ? left : 512;
        for (size_t i = 0; i < n; i++, value += array->stride)
            block[i] = value;
        fwrite(block, sizeof block[0], n, file);
        left -= n;
    }
}

/* Errors stick to the stream and are asked for once, at the end. */
static void write_array(FILE *file, const sphm_vtp_array *array) {
    uint64_t bytes = byte_count(array);
    fwrite(&bytes, sizeof bytes, 1, file);
    if (array->data)
        fwrite(array->data, 1, bytes, file);
    else
        write_ramp(file, array);
}

sphm_status sphm_vtp_write(const char *path, double time_s, const sphm_vtp_array *arrays, size_t count,
                           sphm_context *context) {
    FILE *file = fopen(path, "wb");
    if (!file)
        return sphm_fail(context, SPHM_REFUSED_FILE, "cannot write '%s': %s", path, strerror(errno));
    write_head(file, time_s, arrays, count);
    for (size_t i = 0; i < count; i++)
        write_array(file, &arrays[i]);
    fprintf(file, "\n  </AppendedData>\n</VTKFile>\n");
    struct stat kind;
    int is_regular = fstat(fileno(file), &kind) == 0 && S_ISREG(kind.st_mode);
    int failed = fflush(file) != 0 || ferror(file), reason = errno;
    if (fclose(file) != 0 && !failed)
        failed = 1, reason = errno;
    if (!failed)
        return SPHM_OK;
    if (is_regular) /* never a device */
        remove(path);
    return sphm_fail(context, SPHM_REFUSED_FILE, "cannot write '%s': %s", path, strerror(reason));
}
