/* From parameters to a muscle, its mesh read on the way. */
#include "core/context.h"
#include "sph_muscle/io.h"

#include <string.h>

sphm_status sphm_io_create_muscle(const sphm_parameters *parameters, sphm_muscle **muscle,
                                  sphm_context *context) {
    if (!muscle)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "muscle is NULL");
    *muscle = NULL;
    /* Before the mesh is read: a wrong parameter should not wait for, or hide
     * behind, a large file. */
    sphm_status status = sphm_parameters_check(parameters, NULL);
    if (status != SPHM_OK)
        return sphm_parameters_check(parameters, context);
    if (!parameters->mesh[0])
        return sphm_muscle_create(parameters, NULL, muscle, context);
    sphm_surface mesh;
    memset(&mesh, 0, sizeof mesh);
    status = sphm_io_load_surface(parameters->mesh, parameters->mesh_scale, &mesh, context);
    if (status == SPHM_OK)
        status = sphm_muscle_create(parameters, &mesh, muscle, context);
    sphm_surface_free(&mesh);
    return status;
}
