/* How a particle of the solid tissue moves in a step: a free one by its force, an attached one with its end.
 * A motion is displacement x y z, 0, velocity x y z, 0. */
#ifndef SPHM_KERNELS_SOLID_MOTION_H
#define SPHM_KERNELS_SOLID_MOTION_H

#include "kernels/end_block.h"

/* Kick and drift of a free particle. */
typedef struct sphm_solid_mover {
    sphm_real kick;       /* step over the mean inertia, s/kg */
    sphm_real keep;       /* what drag leaves of a velocity */
    sphm_real step;       /* s */
    sphm_real gravity[3]; /* step times gravity over mass scaling, m/s */
} sphm_solid_mover;

/* Along one axis. `kick` is the particle's own. */
SPHM_FN void sphm_solid_move_along(const sphm_solid_mover *m, sphm_real kick, sphm_real gravity,
                                   sphm_real force, sphm_real *shift, sphm_real *velocity) {
    *velocity = m->keep * *velocity + (kick * force + gravity);
    *shift += m->step * *velocity;
}

SPHM_FN void sphm_solid_move(const sphm_solid_mover *m, sphm_real relative_volume, const sphm_real force[3],
                             sphm_real motion[8]) {
    const sphm_real kick = m->kick / relative_volume;
    for (int d = 0; d < 3; ++d)
        sphm_solid_move_along(m, kick, m->gravity[d], force[d], &motion[d], &motion[4 + d]);
}

/* What moves an attached particle that is at X at rest (state positions, as the centre c):
 *     u = shift + (R - 1)(X - c),   v = V + w x R (X - c)
 * with single precision left to the last operation. */
typedef struct sphm_end_frame {
    double shift[3], turn_minus_one[9], spin_turn[9], velocity[3], centre[3];
} sphm_end_frame;

/* frame_m: what state positions are relative to. */
SPHM_FN void sphm_end_frame_of(const sphm_end_block *block, const sphm_end_body *body,
                               const double frame_m[3], sphm_end_frame *f) {
    const double *R = body->rotation;
    double w[3];
    sphm_end_body_spin(block, R, body->momentum_Nms, w);
    for (int d = 0; d < 3; ++d) {
        const int e = (d + 1) % 3, g = (d + 2) % 3;
        f->centre[d] = block->centre_m[d] - frame_m[d];
        f->shift[d] = body->shift_m[d];
        f->velocity[d] = body->velocity_m_per_s[d];
        for (int c = 0; c < 3; ++c) {
            f->turn_minus_one[3 * d + c] = R[3 * d + c] - (d == c);
            f->spin_turn[3 * d + c] = w[e] * R[3 * g + c] - w[g] * R[3 * e + c];
        }
    }
}

SPHM_FN void sphm_end_carry(const sphm_end_frame *f, const double rest[3], sphm_real motion[8]) {
    double arm[3], turned[3], spun[3];
    for (int d = 0; d < 3; ++d)
        arm[d] = rest[d] - f->centre[d];
    sphm_multiply3(f->turn_minus_one, arm, turned);
    sphm_multiply3(f->spin_turn, arm, spun);
    for (int d = 0; d < 3; ++d) {
        motion[d] = (sphm_real)(f->shift[d] + turned[d]);
        motion[4 + d] = (sphm_real)(f->velocity[d] + spun[d]);
    }
}

SPHM_FN int sphm_motion_is_finite(const sphm_real motion[8]) {
    sphm_real sum = 0; /* of zeroes, unless one is not finite */
    for (int d = 0; d < 7; ++d)
        sum += motion[d] * 0;
    return sum == 0;
}

#endif
