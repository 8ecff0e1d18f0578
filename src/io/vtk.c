/* The muscle as VTK files: particles with every field, and the skinned surface
 * with the fields that can be drawn on it. Positions are metres in the muscle's
 * frame; names carry units. */
#include "core/context.h"
#include "io/vtp.h"
#include "sph_muscle/io.h"

#include <stdlib.h>
#include <string.h>

static sphm_vtp_array array(sphm_vtp_section section, const char *name, sphm_vtp_type type, int components,
                            size_t tuples, const void *data) {
    sphm_vtp_array a = {section, name, type, components, tuples, data, 0, 0};
    return a;
}

/* first, first + stride, ... as 64-bit integers: the connectivity and offsets
 * of regular cells. */
static sphm_vtp_array ramp(sphm_vtp_section section, const char *name, size_t tuples, int64_t first,
                           int64_t stride) {
    sphm_vtp_array a = {section, name, SPHM_VTP_INT64, 1, tuples, NULL, first, stride};
    return a;
}

static sphm_vtp_array scalar(const char *name, size_t tuples, const float *data) {
    return array(SPHM_VTP_POINT_DATA, name, SPHM_VTP_FLOAT32, 1, tuples, data);
}

static sphm_vtp_array vector(const char *name, size_t tuples, const float *data) {
    return array(SPHM_VTP_POINT_DATA, name, SPHM_VTP_FLOAT32, 3, tuples, data);
}

/* `rest`: [3 * count] fibres, then [count] volumes. */
static sphm_status write_particles(const sphm_particles *p, const sphm_body *body, const float *rest,
                                   double time_s, const char *path, sphm_context *context) {
    size_t n = p->count;
    const sphm_vtp_array arrays[] = {
        array(SPHM_VTP_POINTS, "position_m", SPHM_VTP_FLOAT32, 3, n, p->position_m),
        scalar("displacement_m", n, p->displacement_m),
        scalar("pressure_Pa", n, p->pressure_Pa),
        scalar("electrical_pressure_Pa", n, p->electrical_pressure_Pa),
        scalar("density_kg_per_m3", n, p->density_kg_per_m3),
        scalar("membrane_potential_mV", n, p->membrane_potential_mV),
        scalar("recovery", n, p->recovery),
        scalar("activation", n, p->activation),
        scalar("fibre_stretch", n, p->fibre_stretch),
        vector("velocity_m_per_s", n, p->velocity_m_per_s),
        vector("displacement_vector_m", n, p->displacement_vector_m),
        vector("rest_fibre", n, rest),
        scalar("rest_volume_m3", n, rest + 3 * n),
        array(SPHM_VTP_POINT_DATA, "attachment", SPHM_VTP_UINT8, 1, n, body->attachment),
        array(SPHM_VTP_POINT_DATA, "region", SPHM_VTP_UINT8, 1, n, body->region),
        ramp(SPHM_VTP_VERTICES, "connectivity", n, 0, 1),
        ramp(SPHM_VTP_VERTICES, "offsets", n, 1, 1),
    };
    return sphm_vtp_write(path, time_s, arrays, sizeof arrays / sizeof arrays[0], context);
}

sphm_status sphm_io_write_particles_vtk(sphm_muscle *muscle, const char *path, sphm_context *context) {
    if (!muscle || !path)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "muscle or path is NULL");
    sphm_particles particles;
    sphm_status status = sphm_muscle_particles(muscle, &particles, context);
    if (status != SPHM_OK)
        return status;
    const sphm_body *body = sphm_muscle_body(muscle);
    float *rest = malloc(4 * body->count * sizeof *rest);
    if (!rest)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the rest shape of %zu particles",
                         body->count);
    for (size_t i = 0; i < 3 * body->count; i++)
        rest[i] = (float)body->fibres[i];
    for (size_t i = 0; i < body->count; i++)
        rest[3 * body->count + i] = (float)body->volumes[i];
    status = write_particles(&particles, body, rest, sphm_muscle_time(muscle), path, context);
    free(rest);
    return status;
}

static const char *const field_names[SPHM_FIELD_COUNT] = {
    "displacement_m", "pressure_Pa", "membrane_potential_mV", "activation", "fibre_stretch",
};

/* The skin shows one field at a time; `fields` is
 * [SPHM_FIELD_COUNT][vertex_count], filled here. */
static sphm_status write_surface(sphm_muscle *muscle, float *fields, size_t n, const char *path,
                                 sphm_context *context) {
    sphm_skin skin;
    for (int field = 0; field < SPHM_FIELD_COUNT; field++) {
        sphm_status status = sphm_muscle_skin(muscle, field, &skin, context);
        if (status != SPHM_OK)
            return status;
        memcpy(fields + (size_t)field * n, skin.field, n * sizeof *fields);
    }
    sphm_vtp_array arrays[SPHM_FIELD_COUNT + 3];
    arrays[0] = array(SPHM_VTP_POINTS, "position_m", SPHM_VTP_FLOAT32, 3, n, skin.vertices_m);
    for (int field = 0; field < SPHM_FIELD_COUNT; field++)
        arrays[1 + field] = scalar(field_names[field], n, fields + (size_t)field * n);
    arrays[SPHM_FIELD_COUNT + 1] =
        array(SPHM_VTP_TRIANGLES, "connectivity", SPHM_VTP_INT32, 1, 3 * skin.triangle_count, skin.triangles);
    arrays[SPHM_FIELD_COUNT + 2] = ramp(SPHM_VTP_TRIANGLES, "offsets", skin.triangle_count, 3, 3);
    return sphm_vtp_write(path, sphm_muscle_time(muscle), arrays, SPHM_FIELD_COUNT + 3, context);
}

sphm_status sphm_io_write_surface_vtk(sphm_muscle *muscle, const char *path, sphm_context *context) {
    if (!muscle || !path)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "muscle or path is NULL");
    sphm_skin skin;
    sphm_status status = sphm_muscle_skin(muscle, SPHM_FIELD_DISPLACEMENT, &skin, context);
    if (status != SPHM_OK)
        return status;
    float *fields = malloc(SPHM_FIELD_COUNT * skin.vertex_count * sizeof *fields);
    if (!fields)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the fields of %zu vertices",
                         skin.vertex_count);
    status = write_surface(muscle, fields, skin.vertex_count, path, context);
    free(fields);
    return status;
}
