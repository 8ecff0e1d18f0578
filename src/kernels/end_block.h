/* The particles attached at an end of the muscle, as one rigid block, and how it moves: it follows a pose, or
 * tissue, tendon, load and weight move it. In double: a block is one for thousands of particles.
 *
 *     m dV/dt = sum f + load + tendon + m g,      dL/dt = sum (x - x_c) x f + (p - x_c) x (load + tendon)
 *
 * m, L: mass and angular momentum about the centre x_c, those of the particles (mass_scaling included, but
 * for the weight); f: internal force on a particle; p: the end of the line of action, carried by the block,
 * where load and tendon pull. Leap-frog like the particles: V and L are half a step behind. Restricting
 * particles to rigid motions lowers the largest frequency there is, so that the block asks for no shorter
 * step; only the tendon can (sphm_end_block_frequency2).
 *
 * Everything in the muscle's frame; matrices row by row. */
#ifndef SPHM_KERNELS_END_BLOCK_H
#define SPHM_KERNELS_END_BLOCK_H

#include "kernels/vector.h"

/* What is constant. */
typedef struct sphm_end_block {
    double particles;                            /* how many; 0: nothing is attached */
    double inertia_kg, weight_kg;                /* scaled mass, and the one that weighs */
    double centre_m[3], point_m[3];              /* at rest: centre of mass, end of the line of action */
    double inertia_kg_m2[9], inverse_inertia[9]; /* about the centre, at rest, scaled; and 1/(kg m2) */
    double axis[3];                              /* line of action at rest, away from the belly */
    double tendon_slack_m, tendon_N_per_m;       /* stiffness 0: no tendon */
} sphm_end_block;

/* What changes. Nothing but doubles: snapshot and hash take them in a row. */
typedef struct sphm_end_body {
    double shift_m[3];          /* of the centre, from its rest position */
    double rotation[9];         /* from rest */
    double velocity_m_per_s[3]; /* of the centre */
    double momentum_Nms[3];     /* angular, about the centre */
} sphm_end_body;

SPHM_FN void sphm_end_body_rest(sphm_end_body *body) {
    for (int d = 0; d < 3; ++d)
        body->shift_m[d] = body->velocity_m_per_s[d] = body->momentum_Nms[d] = 0;
    for (int d = 0; d < 9; ++d)
        body->rotation[d] = d % 4 == 0;
}

/* Angular velocity: R I^-1 R^T L */
SPHM_FN void sphm_end_body_spin(const sphm_end_block *block, const double rotation[9],
                                const double momentum[3], double spin[3]) {
    double own[3], turned[3];
    sphm_multiply3_transposed(rotation, momentum, own);
    sphm_multiply3(block->inverse_inertia, own, turned);
    sphm_multiply3(rotation, turned, spin);
}

/* Displacement, and velocity, of the block's point that is at rest_m at rest. */
SPHM_FN void sphm_end_body_carry(const sphm_end_block *block, const sphm_end_body *body, const double spin[3],
                                 const double rest_m[3], double shift[3], double velocity[3]) {
    double arm[3], turned[3], spun[3];
    for (int d = 0; d < 3; ++d)
        arm[d] = rest_m[d] - block->centre_m[d];
    sphm_multiply3(body->rotation, arm, turned);
    sphm_cross3(spin, turned, spun);
    for (int d = 0; d < 3; ++d) {
        shift[d] = body->shift_m[d] + (turned[d] - arm[d]);
        velocity[d] = body->velocity_m_per_s[d] + spun[d];
    }
}

/* The block follows a frame: position of the end of the line of action, rotation, their rates. */
SPHM_FN void sphm_end_body_follow(const sphm_end_block *block, const double position_m[3],
                                  const double rotation[9], const double velocity[3], const double spin[3],
                                  sphm_end_body *body) {
    double arm[3], turned[3], spun[3], own[3], momentum[3];
    for (int d = 0; d < 3; ++d)
        arm[d] = block->centre_m[d] - block->point_m[d];
    sphm_multiply3(rotation, arm, turned);
    sphm_cross3(spin, turned, spun);
    for (int d = 0; d < 3; ++d) {
        body->shift_m[d] = (position_m[d] - block->point_m[d]) + (turned[d] - arm[d]);
        body->velocity_m_per_s[d] = velocity[d] + spun[d];
    }
    for (int d = 0; d < 9; ++d)
        body->rotation[d] = rotation[d];
    sphm_multiply3_transposed(rotation, spin, own);
    sphm_multiply3(block->inertia_kg_m2, own, momentum);
    sphm_multiply3(rotation, momentum, body->momentum_Nms);
}

/* Force of the tendon on a point of the block at point_m, from a bone at bone_m: k (length - slack) towards
 * the bone when stretched, nothing when slack. */
SPHM_FN void sphm_end_tendon_force(const sphm_end_block *block, const double point_m[3],
                                   const double bone_m[3], double force_N[3]) {
    double along[3];
    for (int d = 0; d < 3; ++d)
        along[d] = bone_m[d] - point_m[d];
    const double length = sqrt(sphm_dot3(along, along)), stretch = length - block->tendon_slack_m;
    const double pull = stretch > 0 && length > 0 ? block->tendon_N_per_m * stretch / length : 0;
    for (int d = 0; d < 3; ++d)
        force_N[d] = pull * along[d];
}

/* One step of a block that is free to move and turn. force: sum of the internal forces; moment: theirs about
 * the centre; pull: at the end of the line of action. keep: what drag leaves of a velocity in this step. */
SPHM_FN void sphm_end_body_step(const sphm_end_block *block, const double force[3], const double moment[3],
                                const double pull[3], const double gravity[3], double step_s, double keep,
                                sphm_end_body *body) {
    double arm[3], turned[3], lever[3], spin[3], half[3], turn[9], rotation[9];
    for (int d = 0; d < 3; ++d)
        arm[d] = block->point_m[d] - block->centre_m[d];
    sphm_multiply3(body->rotation, arm, turned);
    sphm_cross3(turned, pull, lever);
    for (int d = 0; d < 3; ++d) {
        const double push = force[d] + pull[d] + block->weight_kg * gravity[d];
        body->velocity_m_per_s[d] = keep * body->velocity_m_per_s[d] + step_s * push / block->inertia_kg;
        body->momentum_Nms[d] = keep * body->momentum_Nms[d] + step_s * (moment[d] + lever[d]);
        body->shift_m[d] += step_s * body->velocity_m_per_s[d];
    }
    /* The spin of L depends on the rotation: that of the middle of the step. */
    sphm_end_body_spin(block, body->rotation, body->momentum_Nms, spin);
    for (int d = 0; d < 3; ++d)
        half[d] = 0.5 * step_s * spin[d];
    sphm_rotation_of(half, turn);
    sphm_multiply33(turn, body->rotation, rotation);
    sphm_end_body_spin(block, rotation, body->momentum_Nms, spin);
    for (int d = 0; d < 3; ++d)
        half[d] = step_s * spin[d];
    sphm_rotation_of(half, turn);
    sphm_multiply33(turn, body->rotation, rotation);
    for (int d = 0; d < 9; ++d)
        body->rotation[d] = rotation[d];
}

/* The same for a block that slides along the line of action and does not turn. */
SPHM_FN void sphm_end_body_slide(const sphm_end_block *block, const double force[3], const double pull[3],
                                 const double gravity[3], double step_s, double keep, sphm_end_body *body) {
    const double push = sphm_dot3(force, block->axis) + sphm_dot3(pull, block->axis) +
                        block->weight_kg * sphm_dot3(gravity, block->axis);
    const double speed =
        keep * sphm_dot3(body->velocity_m_per_s, block->axis) + step_s * push / block->inertia_kg;
    for (int d = 0; d < 3; ++d) {
        body->velocity_m_per_s[d] = speed * block->axis[d];
        body->momentum_Nms[d] = 0;
        body->shift_m[d] += step_s * speed * block->axis[d];
    }
}

/* A bound on the squared frequency (1/s2) that the tendon adds: its stiffness, which that across it never
 * exceeds, times the largest mobility of the point it pulls at, 1/m - [a] I^-1 [a] (by its trace). */
SPHM_FN double sphm_end_block_frequency2(const sphm_end_block *block) {
    double arm[3], mobility = block->inertia_kg > 0 ? 1 / block->inertia_kg : 0;
    if (!(block->tendon_N_per_m > 0) || !(block->particles > 0))
        return 0;
    for (int d = 0; d < 3; ++d)
        arm[d] = block->point_m[d] - block->centre_m[d];
    for (int d = 0; d < 3; ++d) {
        double unit[3] = {d == 0 ? 1.0 : 0.0, d == 1 ? 1.0 : 0.0, d == 2 ? 1.0 : 0.0}, lever[3], spin[3];
        sphm_cross3(arm, unit, lever);
        sphm_multiply3(block->inverse_inertia, lever, spin);
        mobility += sphm_dot3(lever, spin);
    }
    return block->tendon_N_per_m * mobility;
}

#endif
