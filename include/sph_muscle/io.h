/* Files: meshes (assimp), configuration (YAML), time series (CSV) and VTK. The library sph_muscle_io stands
 * beside the computing core; meshes and YAML are refused with SPHM_REFUSED_UNSUPPORTED where CMake did not
 * find their libraries. CSV and VTK are always there. */
#ifndef SPH_MUSCLE_IO_H
#define SPH_MUSCLE_IO_H

#include "sph_muscle/muscle.h"

#ifdef __cplusplus
extern "C" {
#endif

/* 1 where the library was built with assimp / with libyaml. */
int sphm_io_has_mesh(void);
int sphm_io_has_yaml(void);

/* Reads every triangle of the file, times scale_m. Refuses a missing or unreadable file (naming it and the
 * reader's reason), one without triangles, and non-finite vertices. */
sphm_status sphm_io_load_surface(const char *path, double scale_m, sphm_surface *surface,
                                 sphm_context *context);
/* Sets the parameters a YAML mapping "name: value" names. Relative paths in `mesh` and `fibre_file` are
 * taken from the folder of the file. Refuses bad YAML (with line and column), unknown names, nested maps,
 * duplicate keys and values out of range; `parameters` is unchanged then. `stimulus` may be a list. */
sphm_status sphm_io_load_parameters(const char *path, sphm_parameters *parameters, sphm_context *context);
/* Writes every parameter, with unit and help as comments, such that sphm_io_load_parameters() gives the same
 * ones again (paths are made absolute). Needs no YAML library. */
sphm_status sphm_io_save_parameters(const sphm_parameters *parameters, const char *path,
                                    sphm_context *context);
/* Loads the mesh if the parameters name one and creates the muscle. */
sphm_status sphm_io_create_muscle(const sphm_parameters *parameters, sphm_muscle **muscle,
                                  sphm_context *context);

/* Particles and skinned surface as VTK files ParaView opens (PolyData, binary appended .vtp); fields carry
 * their units in their names. */
sphm_status sphm_io_write_particles_vtk(sphm_muscle *muscle, const char *path, sphm_context *context);
sphm_status sphm_io_write_surface_vtk(sphm_muscle *muscle, const char *path, sphm_context *context);

/* A .pvd file that lists VTK files with their simulated times, so that ParaView shows them as one animation.
 * The file is complete after every add, whatever happens to the program later. `file` is relative to it. */
typedef struct sphm_collection sphm_collection;
sphm_status sphm_io_collection_open(const char *path, sphm_collection **collection, sphm_context *context);
sphm_status sphm_io_collection_add(sphm_collection *collection, double time_s, const char *file,
                                   sphm_context *context);
sphm_status sphm_io_collection_close(sphm_collection *collection, sphm_context *context); /* NULL is fine */

/* A CSV time series of observations; column names carry units. */
typedef struct sphm_timeseries sphm_timeseries;
sphm_status sphm_io_timeseries_open(const char *path, sphm_timeseries **series, sphm_context *context);
sphm_status sphm_io_timeseries_write(sphm_timeseries *series, const sphm_observation *observation,
                                     double real_time_factor, sphm_context *context);
sphm_status sphm_io_timeseries_close(sphm_timeseries *series, sphm_context *context); /* NULL is fine */

#ifdef __cplusplus
}
#endif
#endif
