/* How particles of the fluid move: the best rigid motion of the whole muscle (21), the velocity that is
 * predicted from it (20, 23), and which stage of a step was the first that went wrong. */
#ifndef SPHM_KERNELS_FLUID_MOTION_H
#define SPHM_KERNELS_FLUID_MOTION_H

#include "kernels/fluid.h"
#include "kernels/vector.h"

/* Sums over particles that shape matching needs, all masses equal: x X^T row by row, x, X. */
#define SPHM_MOMENT_SUMS 15

SPHM_FN void sphm_rigid_add(const double x[3], const double rest[3], double sums[SPHM_MOMENT_SUMS]) {
    for (int a = 0; a < 3; ++a) {
        sums[9 + a] += x[a];
        sums[12 + a] += rest[a];
        for (int c = 0; c < 3; ++c)
            sums[3 * a + c] += x[a] * rest[c];
    }
}

/* The motion that carries the rest shape best: x = rotation (X - rest_centre) + centre (Mueller et al.,
 * SIGGRAPH 2005). */
typedef struct sphm_rigid_motion {
    double rotation[9], centre[3], rest_centre[3];
} sphm_rigid_motion;

/* From the sums over `count` particles. On the rest shape the moment is symmetric to the bit, so that the
 * rotation is exactly the identity and nothing moves. */
SPHM_FN void sphm_rigid_find(const double sums[SPHM_MOMENT_SUMS], double count, sphm_rigid_motion *motion) {
    double moment[9];
    for (int a = 0; a < 3; ++a)
        for (int c = 0; c < 3; ++c)
            moment[3 * a + c] = sums[3 * a + c] - sums[9 + a] * sums[12 + c] / count;
    for (int d = 0; d < 3; ++d) {
        motion->centre[d] = sums[9 + d] / count;
        motion->rest_centre[d] = sums[12 + d] / count;
    }
    sphm_best_rotation(moment, motion->rotation);
}

/* g - x of (23), written so that it is exactly 0 on the rest shape:
 * (R - 1)(X - X0) + (x0 - X0) - (x - X), with x0 and X0 the centres. */
typedef struct sphm_goal {
    sphm_real turn[9], shift[3], rest_centre[3];
} sphm_goal;

SPHM_FN sphm_goal sphm_goal_of(const sphm_rigid_motion *motion) {
    sphm_goal g;
    for (int k = 0; k < 9; ++k)
        g.turn[k] = (sphm_real)(motion->rotation[k] - (k % 4 == 0));
    for (int d = 0; d < 3; ++d) {
        g.shift[d] = (sphm_real)(motion->centre[d] - motion->rest_centre[d]);
        g.rest_centre[d] = (sphm_real)motion->rest_centre[d];
    }
    return g;
}

/* A point force on the particles within its radius, as an acceleration. */
typedef struct sphm_point_pull {
    sphm_real x, y, z, radius2;
    sphm_real a[3];
} sphm_point_pull;

/* Without the acceleration. frame_m: what state positions are relative to. */
SPHM_FN sphm_point_pull sphm_point_pull_at(const double point_m[3], double radius_m,
                                           const double frame_m[3]) {
    sphm_point_pull p;
    p.x = (sphm_real)(point_m[0] - frame_m[0]);
    p.y = (sphm_real)(point_m[1] - frame_m[1]);
    p.z = (sphm_real)(point_m[2] - frame_m[2]);
    p.radius2 = (sphm_real)(radius_m * radius_m);
    p.a[0] = p.a[1] = p.a[2] = 0;
    return p;
}

SPHM_FN int sphm_point_pull_reaches(const sphm_point_pull *p, const sphm_real x[3]) {
    const sphm_real dx = x[0] - p->x, dy = x[1] - p->y, dz = x[2] - p->z;
    return dx * dx + dy * dy + dz * dz <= p->radius2;
}

/* What a step adds to every velocity. */
typedef struct sphm_prediction {
    sphm_real pull_per_s; /* k_i/dt of (23) */
    sphm_real drift[3];   /* by gravity, m/s */
} sphm_prediction;

SPHM_FN sphm_prediction sphm_prediction_of(const sphm_fluid_constants *c, double step_s) {
    sphm_prediction p;
    p.pull_per_s = (sphm_real)(sphm_shape_matching_coefficient(c, step_s) / step_s);
    for (int d = 0; d < 3; ++d)
        p.drift[d] = (sphm_real)(step_s * (double)c->gravity_m_per_s2[d]);
    return p;
}

/* Velocity under gravity (20), pulled towards the goal (21, 23). */
SPHM_FN void sphm_fluid_predict(const sphm_prediction *p, const sphm_goal *g, const sphm_real x[3],
                                const sphm_real v[3], const sphm_real rest[3], sphm_real predicted[3]) {
    const sphm_real moved[3] = {x[0] - rest[0], x[1] - rest[1], x[2] - rest[2]};
    const sphm_real arm[3] = {rest[0] - g->rest_centre[0], rest[1] - g->rest_centre[1],
                              rest[2] - g->rest_centre[2]};
    for (int d = 0; d < 3; ++d) {
        const sphm_real turned =
            g->turn[3 * d] * arm[0] + g->turn[3 * d + 1] * arm[1] + g->turn[3 * d + 2] * arm[2];
        predicted[d] = v[d] + p->drift[d] + p->pull_per_s * (turned + g->shift[d] - moved[d]);
    }
}

/* Fibres are the rest shape's, and turn with the muscle as a whole. */
SPHM_FN void sphm_fluid_steer(sphm_real beta, const sphm_real rotation[9], sphm_real x, sphm_real y,
                              sphm_real z, sphm_real *vx, sphm_real *vy, sphm_real *vz) {
    sphm_fibre_steer(beta, rotation[0] * x + rotation[1] * y + rotation[2] * z,
                     rotation[3] * x + rotation[4] * y + rotation[5] * z,
                     rotation[6] * x + rotation[7] * y + rotation[8] * z, vx, vy, vz);
}

/* What the stages of a step made of a particle. */
typedef struct sphm_fluid_outcome {
    sphm_real position[3];                                                      /* before the step */
    sphm_real predicted[3], smoothed[3];                                        /* velocities */
    sphm_real density, pressure, inverse_density, acceleration[3], membrane[3]; /* Vm, w, activation */
    sphm_real velocity[3], moved[3];                                            /* after it */
} sphm_fluid_outcome;

SPHM_FN int sphm_fluid_finite3(const sphm_real v[3]) {
    return v[0] - v[0] == 0 && v[1] - v[1] == 0 && v[2] - v[2] == 0;
}

/* The first stage whose values are not finite, or SPHM_FLUID_FINITE (core/fluid_watch.h names them). */
#define SPHM_FLUID_FINITE 8
SPHM_FN int sphm_fluid_bad_stage(const sphm_fluid_outcome *o) {
    if (!sphm_fluid_finite3(o->position))
        return 0;
    if (!sphm_fluid_finite3(o->predicted))
        return 1;
    if (!sphm_fluid_finite3(o->smoothed))
        return 2;
    if (!(o->density - o->density == 0))
        return 3;
    if (!(o->pressure - o->pressure == 0) || !(o->inverse_density - o->inverse_density == 0))
        return 4;
    if (!sphm_fluid_finite3(o->acceleration))
        return 5;
    if (!sphm_fluid_finite3(o->membrane))
        return 6;
    if (!sphm_fluid_finite3(o->velocity) || !sphm_fluid_finite3(o->moved))
        return 7;
    return SPHM_FLUID_FINITE;
}

#endif
