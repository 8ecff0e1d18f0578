/* The muscle: create, stimulate, advance, look, reset, save.
 *
 * A handle belongs to one thread at a time; any number of muscles may live in a process. Times are
 * simulated seconds since creation or reset. */
#ifndef SPH_MUSCLE_MUSCLE_H
#define SPH_MUSCLE_MUSCLE_H

#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_muscle sphm_muscle;

/* Builds a muscle at rest. Parameters and `mesh` (NULL: the preset) are copied. The schedule in
 * parameters->stimulus is installed. On anything but SPHM_OK *muscle is NULL. */
sphm_status sphm_muscle_create(const sphm_parameters *parameters, const sphm_surface *mesh,
                               sphm_muscle **muscle, sphm_context *context);
void sphm_muscle_destroy(sphm_muscle *muscle); /* NULL is fine */

/* Back to the rest state at time 0: commands, start poses, external forces and failures are forgotten, the
 * schedule of the parameters starts again, and so does the start-up phase. */
sphm_status sphm_muscle_reset(sphm_muscle *muscle, sphm_context *context);

/* The start-up phase, tissue: solid. A muscle that does not begin at rest (initial_stretch, a start pose,
 * gravity, surface_pressure) is not ready after creation and reset: it is first to come to rest as the
 * parameters settle_time and settle_speed say, with both ends held and nothing activated. That goes before
 * time 0; commands given meanwhile act from time 0 on. sphm_muscle_advance(), _step() and _save() run it to
 * its end where nobody else did; until it is over, time and steps are 0, observations and wrenches show the
 * phase, and an end's pose is the one it starts from. */
int sphm_muscle_ready(const sphm_muscle *muscle);
/* Runs the phase for about duration_s of its own time; less when the muscle is ready before, or was. A
 * warning to the log when it did not come to rest. */
sphm_status sphm_muscle_start_up(sphm_muscle *muscle, double duration_s, sphm_context *context);

/* Advances by exactly duration_s > 0 in the fewest equal steps the time-step limits allow.
 * SPHM_FAILED_NONFINITE names the first particle and stage that became non-finite, or says that the particles
 * ran away towards it. */
sphm_status sphm_muscle_advance(sphm_muscle *muscle, double duration_s, sphm_context *context);
/* Takes `count` steps of sphm_muscle_time_step(). */
sphm_status sphm_muscle_step(sphm_muscle *muscle, size_t count, sphm_context *context);
/* The step in use, s, and every limit on it, s (infinite where one does not apply). */
typedef struct sphm_time_step_limits {
    double courant, acoustic, viscous, diffusion, shape_matching, smallest;
} sphm_time_step_limits;
double sphm_muscle_time_step(const sphm_muscle *muscle);
sphm_time_step_limits sphm_muscle_time_step_limits(const sphm_muscle *muscle);
double sphm_muscle_time(const sphm_muscle *muscle);
uint64_t sphm_muscle_steps(const sphm_muscle *muscle);

/* Drives an electrode ("belly", "origin", "insertion", "both", "sphere") with current_uA_per_mm2 from now
 * on, for duration_s of simulated time; 0 means until replaced. The last command an electrode got wins,
 * over the schedule too. Refuses NaN, infinities, negative durations and unknown electrodes; nothing that
 * runs changes then. NULL electrode: the default one. */
sphm_status sphm_muscle_stimulate(sphm_muscle *muscle, const char *electrode, double current_uA_per_mm2,
                                  double duration_s, sphm_context *context);
/* Adds to the schedule: "START:END:CURRENT[:ELECTRODE[:RATE_HZ:PULSE_S]][; ...]". With a rate it is a train
 * of pulses of PULSE_S seconds. Where entries of one electrode overlap the later one wins. */
sphm_status sphm_muscle_schedule(sphm_muscle *muscle, const char *schedule, sphm_context *context);
/* The current that drives `electrode` (NULL: default) now, uA/mm2; 0 if none or unknown. */
double sphm_muscle_stimulus(const sphm_muscle *muscle, const char *electrode);

/* Pulls the particles within radius_m of point_m (as they are now, at each step) with force_N in all,
 * shared by mass, for duration_s (0: until reset). Refuses non-finite values, radius <= 0 and negative
 * durations. At most 16 at a time; one more is refused. Each forgets itself when it ends. */
sphm_status sphm_muscle_apply_force(sphm_muscle *muscle, const double point_m[3], const double force_N[3],
                                    double radius_m, double duration_s, sphm_context *context);

/* The solid tissue: these refuse a fluid muscle with SPHM_REFUSED_UNSUPPORTED. ----------------------------
 */
/* Commands the activation, 0 ... 1, of all particles, past the electrophysiology, which stands still
 * meanwhile; it is reached through the filter of activation_time and deactivation_time. duration_s 0: until
 * replaced; after a duration the membrane commands again. Refuses what is not within 0 ... 1. */
sphm_status sphm_muscle_activate(sphm_muscle *muscle, double activation, double duration_s,
                                 sphm_context *context);
/* Hands back to the membrane at once. */
sphm_status sphm_muscle_release_activation(sphm_muscle *muscle, sphm_context *context);

enum { SPHM_END_ORIGIN, SPHM_END_INSERTION, SPHM_END_COUNT };

/* What an end does. Its attached particles move as one rigid block whatever it is:
 * held      follows its pose, and holds the last one; through its tendon, if it has one
 * loaded    is pulled by a constant force at its end of the line of action, and moves and turns freely
 * free      the same without a load
 * sliding   moves along the rest line of action only, does not turn, and is pulled by a load along it */
enum { SPHM_END_HELD, SPHM_END_LOADED, SPHM_END_FREE, SPHM_END_SLIDING };

/* Where an end's frame is, in the muscle's frame. At rest its origin is that end of the line of action
 * (sphm_body: origin_m, insertion_m), or of the tendon there, drawn out to its slack length, and its axes are
 * the muscle's. */
typedef struct sphm_end_pose {
    double position_m[3];
    double orientation[4];                                     /* unit quaternion x, y, z, w */
    double velocity_m_per_s[3], angular_velocity_rad_per_s[3]; /* when it arrives there; 0 when in doubt */
} sphm_end_pose;

/* Moves an end from where it is to `pose` within duration_s, with continuous velocity. When no further pose
 * arrives it comes to rest there and holds. An end that was loaded, free or sliding is held from now on.
 * Refuses what is not finite, an unknown end, and a pose farther from the present one than max_pose_jump of
 * the muscle's length. */
sphm_status sphm_muscle_set_end_pose(sphm_muscle *muscle, int end, const sphm_end_pose *pose,
                                     double duration_s, sphm_context *context);
/* Where an end is when time begins, in place of its rest pose or initial_stretch; velocities are ignored. The
 * end goes there in the start-up phase. Refused once that or time has begun, without one (settle_time: 0),
 * and farther than max_pose_jump from rest. */
sphm_status sphm_muscle_set_start_pose(sphm_muscle *muscle, int end, const sphm_end_pose *pose,
                                       sphm_context *context);
/* Lets an end carry a load: force_N on the end, in the muscle's frame, until replaced. Inertia: the block's
 * own mass (mass_scaling included); no damping but the tissue's. A tendon only adds its length, for it has no
 * mass. Refuses what is not finite and an end without attached particles. */
sphm_status sphm_muscle_set_end_load(sphm_muscle *muscle, int end, const double force_N[3],
                                     sphm_context *context);
/* Lets an end slide along the rest line of action, from where it is and without turning any more; force_N
 * pulls it away from the belly, below 0 towards it. Motion across the line, and spin, stop at once. */
sphm_status sphm_muscle_slide_end(sphm_muscle *muscle, int end, double force_N, sphm_context *context);
/* Lets go of an end. It keeps its velocity, and may be held (sphm_muscle_set_end_pose, from where it then is)
 * or loaded again. */
sphm_status sphm_muscle_release_end(sphm_muscle *muscle, int end, sphm_context *context);
/* SPHM_END_HELD, ... and, where `load_N` is not NULL, the load of a loaded or sliding end, else 0. -1 for an
 * unknown end and for the fluid. */
int sphm_muscle_end_condition(const sphm_muscle *muscle, int end, double load_N[3]);
/* Where the tendon of an end begins at the belly and ends at the bone now; 0 where there is no tendon. */
int sphm_muscle_tendon(const sphm_muscle *muscle, int end, double belly_m[3], double bone_m[3]);
/* The end's frame now. Beyond the tendon of an end that is not held, where its bone would be. */
sphm_status sphm_muscle_end_pose(const sphm_muscle *muscle, int end, sphm_end_pose *pose,
                                 sphm_context *context);

/* What the muscle does to the bone, or load, at an end: the sum of the tissue's internal forces on the
 * attached particles, without their inertia. Moments are about the present origin of the end's frame; both in
 * the muscle's frame. A muscle that pulls has force[insertion] pointing towards the origin. The parts add up:
 * active: the fibres' active stress; damping: viscosity; passive: everything else. A held end with a tendon:
 * force is the tendon's, the moment about its bone 0, and the parts are the tissue's, which add up to force
 * but for the inertia of the attached block. */
typedef struct sphm_wrench {
    double force_N[3], moment_Nm[3];
    double active_N[3], passive_N[3], damping_N[3];
    double active_Nm[3], passive_Nm[3], damping_Nm[3];
} sphm_wrench;
sphm_status sphm_muscle_wrench(sphm_muscle *muscle, int end, sphm_wrench *wrench, sphm_context *context);

const sphm_parameters *sphm_muscle_parameters(const sphm_muscle *muscle);
const sphm_body *sphm_muscle_body(const sphm_muscle *muscle);
/* What it computes on, e.g. "cpu, 2 threads". Lives as long as the muscle. */
const char *sphm_muscle_device(const sphm_muscle *muscle);

/* Particle fields by particle id, gathered on request into buffers the muscle owns; valid until the next
 * non-const call on it. */
typedef struct sphm_particles {
    size_t count;
    const float *position_m;       /* [3 * count] */
    const float *velocity_m_per_s; /* [3 * count] */
    const float
        *displacement_vector_m;  /* [3 * count], from the rest shape carried by the best rigid motion */
    const float *displacement_m; /* [count], its length */
    const float *pressure_Pa;    /* [count], positive in compression, electrical part included */
    const float *electrical_pressure_Pa; /* [count] */
    const float *density_kg_per_m3;      /* [count] */
    const float *membrane_potential_mV;  /* [count] */
    const float *recovery;               /* [count], w */
    const float *activation;             /* [count], 0 ... 1 */
    const float *fibre_stretch;          /* [count], current over rest length along the fibre */
} sphm_particles;
sphm_status sphm_muscle_particles(sphm_muscle *muscle, sphm_particles *particles, sphm_context *context);

/* Sums over the muscle (observables.c). Regions: origin, centre, insertion. */
typedef struct sphm_observation {
    double time_s;
    double stimulus_uA_per_mm2;                                    /* of the default electrode */
    double activation;                                             /* volume mean */
    double membrane_potential_mV, membrane_potential_region_mV[3]; /* means */
    double displacement_mean_m, displacement_max_m;
    double displacement_region_m[3];   /* means */
    double displacement_plane_m[3][3]; /* [region][xy, yz, xz]: mean length within the plane */
    double displacement_sections_m;    /* mean displacement of the centroids of 20 sections */
    double displacement_surface_m;     /* mean over the outermost particles */
    double deformation_by_radius, deformation_by_length; /* mean displacement over rest mid radius, length */
    double pressure_mean_Pa, pressure_region_Pa[3], electrical_pressure_mean_Pa;
    double length_m; /* along the line of action, between the centroids of the two ends */
    double lengthening_speed_m_per_s;
    double shortening;   /* 1 - length / rest length */
    double bulge;        /* mean radius of the centre region over its rest value, minus 1 */
    double volume_ratio; /* sum of m/rho over its rest value */
    double kinetic_energy_J, speed_max_m_per_s;
    /* tissue: solid; 0 in the fluid. Force of the wrench at the insertion along the line from there to the
     * origin's frame, positive in tension, and its parts. */
    double force_N, force_active_N, force_passive_N, force_damping_N;
    double attachment_distance_m;   /* between the frames of the two ends: with tendons, from bone to bone */
    double normalised_fibre_length; /* mean stretch of the fibres that are not attached, over
                                       optimal_fibre_stretch */
    uint64_t nonfinite;             /* particles with a non-finite value; 0 in a healthy state */
} sphm_observation;
sphm_status sphm_muscle_observe(sphm_muscle *muscle, sphm_observation *observation, sphm_context *context);

/* Both without waiting, for whoever shows a muscle while it runs: begins a look at the present state, if none
 * is under way, and hands out the last one that has finished; observation->time_s is its time. What has not
 * been looked at yet since creation, reset or restore is waited for. A GPU looks beside the steps that
 * follow, so what is handed out is mostly that of the call before; a CPU always shows the present. Either may
 * be NULL; both are of the same moment. */
sphm_status sphm_muscle_glance(sphm_muscle *muscle, sphm_particles *particles, sphm_observation *observation,
                               sphm_context *context);
/* Simulated time of what the last glance, of either kind, has handed out. */
double sphm_muscle_glance_time(const sphm_muscle *muscle);

/* The whole state, byte for byte: FNV-1a of all state arrays by particle id, and of the time. */
uint64_t sphm_muscle_hash(sphm_muscle *muscle);
/* Little-endian, versioned, checksummed; written to a temporary file beside `path` and renamed. Loading
 * refuses a truncated or foreign file, and one of another muscle (rest shape or parameters of the physics),
 * and then leaves the muscle as it was. A restored state continues bit for bit. */
sphm_status sphm_muscle_save(sphm_muscle *muscle, const char *path, sphm_context *context);
sphm_status sphm_muscle_load(sphm_muscle *muscle, const char *path, sphm_context *context);

/* The deforming surface: vertices carried by nearby particles, exact under affine motion (skin.c). */
typedef struct sphm_skin {
    size_t vertex_count, triangle_count;
    const float *vertices_m;  /* [3 * vertex_count], now */
    const int32_t *triangles; /* [3 * triangle_count] */
    const float *field;       /* [vertex_count], the field asked for, smoothly interpolated */
} sphm_skin;
/* `field`: SPHM_FIELD_...; buffers are the muscle's, valid until the next non-const call on it. */
sphm_status sphm_muscle_skin(sphm_muscle *muscle, int field, sphm_skin *skin, sphm_context *context);
/* Of the last look that has finished, as sphm_muscle_glance(). */
sphm_status sphm_muscle_glance_skin(sphm_muscle *muscle, int field, sphm_skin *skin, sphm_context *context);

/* The most kinds of launches that a back end may have. */
enum { SPHM_LAUNCH_KINDS = 24 };

/* Where the time went since creation, reset or the last sphm_muscle_reset_timing(), s of wall time. */
typedef struct sphm_timing {
    uint64_t steps;
    double total_s, neighbours_s, intermediate_velocity_s, density_pressure_s, forces_s, diffusion_s,
        cell_model_s, integration_s; /* shape matching counts to the intermediate velocity */
    double neighbours_per_particle;  /* mean, within the support radius */
    uint64_t neighbour_rebuilds;
    size_t memory_bytes; /* of the state and what computes on it, and of the buffers of what was looked at */
    /* Of a back end on a device that is told to time its launches one by one (doc/cuda.md): kinds of launches
     * and the time they took, 0 ... launch_kinds - 1 of each array; else launch_kinds is 0. What lies beyond
     * is not meant to be read. */
    size_t launch_kinds;                        /* 0 ... SPHM_LAUNCH_KINDS */
    const char *launch_name[SPHM_LAUNCH_KINDS]; /* constant text, never freed */
    double launch_s[SPHM_LAUNCH_KINDS];         /* on the device, s; 0 for kinds that did not occur */
} sphm_timing;
sphm_timing sphm_muscle_timing(const sphm_muscle *muscle);
void sphm_muscle_reset_timing(sphm_muscle *muscle);

#ifdef __cplusplus
}
#endif
#endif
