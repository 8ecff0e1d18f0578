/* Looking at a muscle: what one particle adds to the sums of an observation, the best rigid motion and the
 * centroids that come of the sums, and the fields of one particle as messages show them. Sums are in double;
 * who adds what up in which order is the caller's business.
 *
 * Two passes, for displacements refer to the motion that the first one finds:
 *
 *     shape sums -> sphm_look_shape (motion, centroids) -> field sums
 *
 * Positions are relative to the frame of the state. */
#ifndef SPHM_KERNELS_LOOK_H
#define SPHM_KERNELS_LOOK_H

#include "kernels/vector.h"
#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SPHM_SECTIONS = 20 };

/* Fixed by the rest shape. */
typedef struct sphm_look_constants {
    double count; /* particles */
    double section_count[SPHM_SECTIONS], end_count[2];
    double rest_centre_m[3], axis[3], frame_m[3];
    double particle_mass_kg;                 /* mean */
    double resting_mV, electrical_Pa_per_mV; /* 0: the coupling is not through the pressure */
} sphm_look_constants;

/* What a particle belongs to. */
typedef struct sphm_look_role {
    uint8_t section;           /* 0 ... SPHM_SECTIONS - 1 */
    uint8_t end;               /* 1: at the origin, 2: at the insertion, 0 */
    uint8_t region;            /* SPHM_REGION_... */
    uint8_t outer;             /* of the outermost layer */
    uint8_t attached;          /* to either end */
    sphm_real relative_volume; /* at rest, over the mean; of the mass, too */
} sphm_look_role;

/* A particle as it is now. Lines of these lie in a device's memory: 12 numbers, three loads of 16 bytes. */
typedef struct sphm_look_particle {
    sphm_real place_m[3], density_kg_per_m3;
    sphm_real velocity_m_per_s[3], pressure_Pa;
    sphm_real potential_mV, recovery, activation, unused;
} sphm_look_particle;

/* x = to + rotation (X - from), and how fast that changes. */
typedef struct sphm_look_motion {
    double rotation[9];
    double from_m[3], to_m[3];   /* centroids of the rest shape and of the present one */
    double turning_rad_per_s[3]; /* angular velocity in the frame of the rest shape: d/dt R = R [turning] */
} sphm_look_motion;

/* What the first pass comes to. */
typedef struct sphm_look_shape {
    sphm_look_motion motion;
    double section_m[SPHM_SECTIONS][3];    /* centroids; 0 where a section is empty */
    double end_m[2][3], end_m_per_s[2][3]; /* centroids of the two ends, and their velocities */
} sphm_look_shape;

/* The first pass; only doubles, so that parts add up number by number. Places relative to the rest centroid.
 */
typedef struct sphm_shape_sums {
    double position[3], velocity[3];
    double moment[9], moment_rate[9]; /* sum x X^T, sum v X^T */
    double section[SPHM_SECTIONS][3];
    double end[2][3], end_velocity[2][3];
} sphm_shape_sums;

/* The second pass; only doubles. */
typedef struct sphm_field_sums {
    double activation, volume_m3, kinetic_J, electrical_Pa, nonfinite;
    double displacement_m, surface_m, radius_m; /* the last of the centre region only */
    double region_m[3], region_plane_m[3][3], region_mV[3], region_Pa[3];
    double stretch;                          /* of the fibres that are not attached */
    double speed_max2, displacement_max2_m2; /* greatest values, not sums */
} sphm_field_sums;

enum {
    SPHM_SHAPE_NUMBERS = sizeof(sphm_shape_sums) / sizeof(double),
    SPHM_FIELD_NUMBERS = sizeof(sphm_field_sums) / sizeof(double),
    SPHM_FIELD_SUMMED = SPHM_FIELD_NUMBERS - 2, /* before the greatest values */
    SPHM_LOOK_FIELDS = 17                       /* numbers of a particle in messages */
};

/* First pass ----------------------------------------------------------------------------------------------
 */

SPHM_FN void sphm_look_add_shape(const sphm_look_constants *c, const sphm_look_role *role,
                                 const sphm_real rest_m[3], const sphm_look_particle *p,
                                 sphm_shape_sums *sums) {
    double x[3], v[3], rest[3];
    for (int a = 0; a < 3; ++a) {
        x[a] = (double)p->place_m[a] - c->rest_centre_m[a];
        v[a] = (double)p->velocity_m_per_s[a];
        rest[a] = (double)rest_m[a] - c->rest_centre_m[a];
    }
    for (int a = 0; a < 3; ++a) {
        sums->position[a] += x[a];
        sums->velocity[a] += v[a];
        sums->section[role->section][a] += x[a];
        for (int b = 0; b < 3; ++b) {
            sums->moment[3 * a + b] += x[a] * rest[b];
            sums->moment_rate[3 * a + b] += v[a] * rest[b];
        }
    }
    if (role->end)
        for (int a = 0; a < 3; ++a) {
            sums->end[role->end - 1][a] += x[a];
            sums->end_velocity[role->end - 1][a] += v[a];
        }
}

/* Angular velocity of the best rotation R of A = R S: with Omega = R^T dR/dt skew, R^T dA/dt - (dA/dt)^T R =
 * Omega S + S Omega, whose axial vector is (tr(S) I - S) w. Zero where that leaves w open. */
SPHM_FN void sphm_look_turning(const double rotation[9], const double moment[9], const double rate[9],
                               double w[3]) {
    double s[9], t[9], axial[3], m[9];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            s[3 * i + j] = t[3 * i + j] = 0;
            for (int k = 0; k < 3; ++k) {
                s[3 * i + j] += rotation[3 * k + i] * moment[3 * k + j];
                t[3 * i + j] += rotation[3 * k + i] * rate[3 * k + j];
            }
        }
    axial[0] = t[7] - t[5], axial[1] = t[2] - t[6], axial[2] = t[3] - t[1];
    const double trace = s[0] + s[4] + s[8];
    for (int i = 0; i < 9; ++i)
        m[i] = (i % 4 == 0 ? trace : 0) - s[i];
    const double c0 = m[4] * m[8] - m[5] * m[7], c1 = m[5] * m[6] - m[3] * m[8],
                 c2 = m[3] * m[7] - m[4] * m[6];
    const double determinant = m[0] * c0 + m[1] * c1 + m[2] * c2;
    w[0] = w[1] = w[2] = 0;
    if (!(fabs(determinant) > 1e-9 * trace * trace * trace))
        return;
    w[0] = (c0 * axial[0] + (m[2] * m[7] - m[1] * m[8]) * axial[1] + (m[1] * m[5] - m[2] * m[4]) * axial[2]);
    w[1] = (c1 * axial[0] + (m[0] * m[8] - m[2] * m[6]) * axial[1] + (m[2] * m[3] - m[0] * m[5]) * axial[2]);
    w[2] = (c2 * axial[0] + (m[1] * m[6] - m[0] * m[7]) * axial[1] + (m[0] * m[4] - m[1] * m[3]) * axial[2]);
    for (int a = 0; a < 3; ++a)
        w[a] /= determinant;
}

SPHM_FN void sphm_look_find_shape(const sphm_look_constants *c, const sphm_shape_sums *sums,
                                  sphm_look_shape *shape) {
    sphm_best_rotation(sums->moment, shape->motion.rotation);
    sphm_look_turning(shape->motion.rotation, sums->moment, sums->moment_rate,
                      shape->motion.turning_rad_per_s);
    for (int a = 0; a < 3; ++a) {
        shape->motion.from_m[a] = c->rest_centre_m[a];
        shape->motion.to_m[a] = c->rest_centre_m[a] + sums->position[a] / c->count;
        for (int k = 0; k < SPHM_SECTIONS; ++k)
            shape->section_m[k][a] =
                c->section_count[k] > 0 ? c->rest_centre_m[a] + sums->section[k][a] / c->section_count[k] : 0;
        for (int e = 0; e < 2; ++e) {
            shape->end_m[e][a] = c->rest_centre_m[a] + sums->end[e][a] / c->end_count[e];
            shape->end_m_per_s[e][a] = sums->end_velocity[e][a] / c->end_count[e];
        }
    }
}

/* Second pass ---------------------------------------------------------------------------------------------
 */

/* Where the best rigid motion takes a place of the rest shape. */
SPHM_FN void sphm_look_carry(const sphm_look_motion *motion, const double rest_m[3], double place_m[3]) {
    double from[3];
    for (int a = 0; a < 3; ++a)
        from[a] = rest_m[a] - motion->from_m[a];
    sphm_multiply3(motion->rotation, from, place_m);
    for (int a = 0; a < 3; ++a)
        place_m[a] += motion->to_m[a];
}

/* From where the best rigid motion takes the rest place to the present one. */
SPHM_FN void sphm_look_displacement(const sphm_look_motion *motion, const sphm_real rest_m[3],
                                    const sphm_real place_m[3], double displacement_m[3]) {
    const double from[3] = {(double)rest_m[0], (double)rest_m[1], (double)rest_m[2]};
    double carried[3];
    sphm_look_carry(motion, from, carried);
    for (int a = 0; a < 3; ++a)
        displacement_m[a] = (double)place_m[a] - carried[a];
}

/* Distance from the centroid of the particle's section, across the carried axis. */
SPHM_FN double sphm_look_radius(const sphm_look_constants *c, const sphm_look_shape *shape, int section,
                                const sphm_real place_m[3]) {
    double axis[3], d[3];
    sphm_multiply3(shape->motion.rotation, c->axis, axis);
    for (int a = 0; a < 3; ++a)
        d[a] = (double)place_m[a] - shape->section_m[section][a];
    const double along = sphm_dot3(d, axis);
    for (int a = 0; a < 3; ++a)
        d[a] -= along * axis[a];
    return sqrt(sphm_dot3(d, d));
}

/* kappa max(0, Vm - Vr) */
SPHM_FN double sphm_look_electrical_pressure(const sphm_look_constants *c, double potential_mV) {
    const double above = potential_mV - c->resting_mV;
    return above <= 0 || !(c->electrical_Pa_per_mV != 0) ? 0 : c->electrical_Pa_per_mV * above;
}

/* Whether everything a step starts from is finite. */
SPHM_FN int sphm_look_is_finite(const sphm_look_particle *p) {
    int finite = 1;
    for (int a = 0; a < 3; ++a)
        finite = finite && p->place_m[a] - p->place_m[a] == 0 &&
                 p->velocity_m_per_s[a] - p->velocity_m_per_s[a] == 0;
    return finite && p->density_kg_per_m3 - p->density_kg_per_m3 == 0 &&
           p->pressure_Pa - p->pressure_Pa == 0 && p->potential_mV - p->potential_mV == 0 &&
           p->recovery - p->recovery == 0 && p->activation - p->activation == 0;
}

SPHM_FN void sphm_look_add_displacement(const sphm_look_role *role, const double d[3],
                                        sphm_field_sums *sums) {
    const double squared = sphm_dot3(d, d), length = sqrt(squared);
    sums->displacement_m += length;
    sums->region_m[role->region] += length;
    for (int p = 0; p < 3; ++p) { /* xy, yz, xz */
        const double u = d[p == 1 ? 1 : 0], v = d[p == 0 ? 1 : 2];
        sums->region_plane_m[role->region][p] += sqrt(u * u + v * v);
    }
    if (role->outer)
        sums->surface_m += length;
    if (!(squared <= sums->displacement_max2_m2)) /* a NaN shows */
        sums->displacement_max2_m2 = squared;
}

/* `stretch` of the fibre; 0 where the particle is attached, or nobody asks. */
SPHM_FN void sphm_look_add_fields(const sphm_look_constants *c, const sphm_look_shape *shape,
                                  const sphm_look_role *role, const sphm_real rest_m[3],
                                  const sphm_look_particle *p, double stretch, sphm_field_sums *sums) {
    const double v[3] = {(double)p->velocity_m_per_s[0], (double)p->velocity_m_per_s[1],
                         (double)p->velocity_m_per_s[2]};
    const double speed2 = sphm_dot3(v, v);
    double d[3];
    sphm_look_displacement(&shape->motion, rest_m, p->place_m, d);
    sphm_look_add_displacement(role, d, sums);
    if (role->region == SPHM_REGION_CENTRE)
        sums->radius_m += sphm_look_radius(c, shape, role->section, p->place_m);
    const double mass_kg = c->particle_mass_kg * (double)role->relative_volume;
    sums->activation += (double)(role->relative_volume * p->activation);
    sums->volume_m3 += mass_kg / (double)p->density_kg_per_m3;
    sums->kinetic_J += 0.5 * mass_kg * speed2;
    sums->region_mV[role->region] += (double)p->potential_mV;
    sums->region_Pa[role->region] += (double)p->pressure_Pa;
    sums->electrical_Pa += sphm_look_electrical_pressure(c, (double)p->potential_mV);
    sums->nonfinite += !sphm_look_is_finite(p);
    sums->stretch += stretch;
    if (!(speed2 <= sums->speed_max2))
        sums->speed_max2 = speed2;
}

/* Adds part to all; greatest values stay the greatest. */
SPHM_FN void sphm_look_add_number(int number, double part, double *all) {
    if (number < SPHM_FIELD_SUMMED)
        *all += part;
    else if (!(part <= *all))
        *all = part;
}

/* Messages ------------------------------------------------------------------------------------------------
 */

/* Stretch along the fibre, |sum c_j (x_j - x_i)| (core/fibre_stretch.c); 1 where the row is empty. Places are
 * `apart` numbers from one another. */
SPHM_FN float sphm_look_stretch(const sphm_real *places_m, size_t apart, size_t i, const int32_t *particle,
                                const float *weight, size_t count) {
    const sphm_real *x = places_m + apart * i;
    sphm_real f[3] = {0, 0, 0};
    for (size_t n = 0; n < count; ++n) {
        const sphm_real *y = places_m + apart * (size_t)particle[n];
        for (int a = 0; a < 3; ++a)
            f[a] += weight[n] * (y[a] - x[a]);
    }
    return count > 0 ? (float)sqrt((double)(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])) : 1.0F;
}

/* Particle i of n into the arrays of sphm_particles, which lie one behind the other in `fields`
 * [SPHM_LOOK_FIELDS * n]; the last of them, the stretch, is left alone. */
SPHM_FN void sphm_look_pack(const sphm_look_constants *c, const sphm_look_motion *motion,
                            const sphm_real rest_m[3], const sphm_look_particle *p, size_t i, size_t n,
                            float *fields) {
    double d[3];
    sphm_look_displacement(motion, rest_m, p->place_m, d);
    for (size_t a = 0; a < 3; ++a) {
        fields[3 * i + a] = (float)((double)p->place_m[a] + c->frame_m[a]);
        fields[3 * n + 3 * i + a] = (float)p->velocity_m_per_s[a];
        fields[6 * n + 3 * i + a] = (float)d[a];
    }
    fields[9 * n + i] = (float)sqrt(sphm_dot3(d, d));
    fields[10 * n + i] = (float)p->pressure_Pa;
    fields[11 * n + i] = (float)sphm_look_electrical_pressure(c, (double)p->potential_mV);
    fields[12 * n + i] = (float)p->density_kg_per_m3;
    fields[13 * n + i] = (float)p->potential_mV;
    fields[14 * n + i] = (float)p->recovery;
    fields[15 * n + i] = (float)p->activation;
}

#ifdef __cplusplus
}
#endif
#endif
