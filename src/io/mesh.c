/* Reading surface meshes with assimp's C API. Writes sphm_surface; repairing it is the core's business. */
#include "core/context.h"
#include "sph_muscle/io.h"

#include <string.h>

#ifdef SPHM_WITH_MESH
#include <assimp/cimport.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

int sphm_io_has_mesh(void) {
    return 1;
}

static void count_triangles(const struct aiScene *scene, size_t *vertices, size_t *triangles) {
    *vertices = *triangles = 0;
    for (unsigned m = 0; m < scene->mNumMeshes; m++) {
        const struct aiMesh *mesh = scene->mMeshes[m];
        *vertices += mesh->mNumVertices;
        for (unsigned f = 0; f < mesh->mNumFaces; f++)
            *triangles += mesh->mFaces[f].mNumIndices == 3;
    }
}

/* All meshes of the scene in one, times scale. Points and lines are left out. */
static void copy_triangles(const struct aiScene *scene, double scale, sphm_surface *surface) {
    double *vertex = surface->vertices;
    int32_t *triangle = surface->triangles;
    size_t base = 0;
    for (unsigned m = 0; m < scene->mNumMeshes; m++) {
        const struct aiMesh *mesh = scene->mMeshes[m];
        for (unsigned v = 0; v < mesh->mNumVertices; v++) {
            *vertex++ = scale * (double)mesh->mVertices[v].x;
            *vertex++ = scale * (double)mesh->mVertices[v].y;
            *vertex++ = scale * (double)mesh->mVertices[v].z;
        }
        for (unsigned f = 0; f < mesh->mNumFaces; f++)
            for (unsigned k = 0; k < 3 && mesh->mFaces[f].mNumIndices == 3; k++)
                *triangle++ = (int32_t)(base + mesh->mFaces[f].mIndices[k]);
        base += mesh->mNumVertices;
    }
}

static sphm_status check_finite(const char *path, const sphm_surface *surface, sphm_context *context) {
    for (size_t v = 0; v < 3 * surface->vertex_count; v++)
        if (!isfinite(surface->vertices[v]))
            return sphm_fail(context, SPHM_REFUSED_FILE,
                             "mesh: %s: vertex %zu has the coordinate %g; all must be finite", path, v / 3,
                             surface->vertices[v]);
    return SPHM_OK;
}

static sphm_status take_scene(const char *path, const struct aiScene *scene, double scale,
                              sphm_surface *surface, sphm_context *context) {
    size_t vertices, triangles;
    count_triangles(scene, &vertices, &triangles);
    if (triangles == 0)
        return sphm_fail(context, SPHM_REFUSED_GEOMETRY,
                         "mesh: %s has no triangles; a closed triangle surface is needed", path);
    if (vertices > INT32_MAX || triangles > INT32_MAX / 3)
        return sphm_fail(context, SPHM_REFUSED_GEOMETRY,
                         "mesh: %s has %zu triangles; at most %d can be taken", path, triangles,
                         INT32_MAX / 3);
    surface->vertices = malloc(3 * vertices * sizeof *surface->vertices);
    surface->triangles = malloc(3 * triangles * sizeof *surface->triangles);
    if (!surface->vertices || !surface->triangles) {
        sphm_surface_free(surface);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the %zu triangles of %s", triangles,
                         path);
    }
    surface->vertex_count = vertices;
    surface->triangle_count = triangles;
    copy_triangles(scene, scale, surface);
    sphm_status status = check_finite(path, surface, context);
    if (status != SPHM_OK)
        sphm_surface_free(surface);
    return status;
}

sphm_status sphm_io_load_surface(const char *path, double scale_m, sphm_surface *surface,
                                 sphm_context *context) {
    memset(surface, 0, sizeof *surface);
    if (!(scale_m > 0) || !isfinite(scale_m))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "mesh_scale is %g m; it must be above 0", scale_m);
    /* assimp says little about a file it cannot open. */
    FILE *file = fopen(path, "rb");
    if (!file)
        return sphm_fail(context, SPHM_REFUSED_FILE, "mesh: %s cannot be opened: %s", path, strerror(errno));
    fclose(file);
    /* PreTransformVertices puts the parts of a scene where its nodes place them (glTF). */
    const struct aiScene *scene = aiImportFile(path, aiProcess_Triangulate | aiProcess_PreTransformVertices);
    if (!scene)
        return sphm_fail(context, SPHM_REFUSED_FILE, "mesh: %s cannot be read: %.300s", path,
                         aiGetErrorString());
    sphm_status status = take_scene(path, scene, scale_m, surface, context);
    aiReleaseImport(scene);
    return status;
}

#else

int sphm_io_has_mesh(void) {
    return 0;
}

sphm_status sphm_io_load_surface(const char *path, double scale_m, sphm_surface *surface,
                                 sphm_context *context) {
    (void)scale_m;
    memset(surface, 0, sizeof *surface);
    return sphm_fail(context, SPHM_REFUSED_UNSUPPORTED,
                     "mesh: %s cannot be read: this library was built without assimp; use a preset", path);
}
#endif
