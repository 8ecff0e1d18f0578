/* Mass, centre and inertia of the rigid block at an end of the muscle; see kernels/end_block.h. */
#include "core/end_blocks.h"

#include <math.h>
#include <string.h>

#include "sph_muscle/muscle.h"

static void find_centre(const sphm_body *body, uint8_t attached, double density, sphm_end_block *block) {
    for (size_t i = 0; i < body->count; ++i) {
        if (body->attachment[i] != attached)
            continue;
        const double mass_kg = density * body->volumes[i];
        ++block->particles;
        block->weight_kg += mass_kg;
        for (int d = 0; d < 3; ++d)
            block->centre_m[d] += mass_kg * body->positions[3 * i + (size_t)d];
    }
    for (int d = 0; d < 3 && block->particles > 0; ++d)
        block->centre_m[d] /= block->weight_kg;
}

/* Particles count as cubes, so that a single one or a row of them can be turned too. */
static void add_inertia(const sphm_body *body, uint8_t attached, double density, sphm_end_block *block) {
    for (size_t i = 0; i < body->count; ++i) {
        if (body->attachment[i] != attached)
            continue;
        double arm[3];
        for (int d = 0; d < 3; ++d)
            arm[d] = body->positions[3 * i + (size_t)d] - block->centre_m[d];
        const double mass_kg = density * body->volumes[i];
        const double square = sphm_dot3(arm, arm) + body->spacing_m * body->spacing_m / 6;
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c)
                block->inertia_kg_m2[3 * r + c] += mass_kg * ((r == c ? square : 0) - arm[r] * arm[c]);
    }
}

/* By cofactors; the inertia of a body is never singular. */
static void invert(const double m[9], double inverse[9]) {
    double cofactor[9];
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) {
            const int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
            cofactor[3 * r + c] = m[3 * r1 + c1] * m[3 * r2 + c2] - m[3 * r1 + c2] * m[3 * r2 + c1];
        }
    const double determinant = m[0] * cofactor[0] + m[1] * cofactor[1] + m[2] * cofactor[2];
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
            inverse[3 * r + c] = cofactor[3 * c + r] / determinant;
}

static int has_tendon(const sphm_parameters *parameters, int end) {
    return parameters->tendon_ends == SPHM_TENDON_BOTH ||
           parameters->tendon_ends == (end == SPHM_END_ORIGIN ? SPHM_TENDON_ORIGIN : SPHM_TENDON_INSERTION);
}

sphm_end_block sphm_end_block_from(const sphm_parameters *parameters, const sphm_body *body, int end) {
    const uint8_t attached = end == SPHM_END_ORIGIN ? SPHM_ATTACHED_ORIGIN : SPHM_ATTACHED_INSERTION;
    sphm_end_block block;
    memset(&block, 0, sizeof block);
    for (int d = 0; d < 3; ++d) {
        block.point_m[d] = end == SPHM_END_ORIGIN ? body->origin_m[d] : body->insertion_m[d];
        block.axis[d] = end == SPHM_END_ORIGIN ? -body->axis[d] : body->axis[d];
    }
    if (parameters->tendon_stiffness > 0 && has_tendon(parameters, end)) {
        block.tendon_slack_m = parameters->tendon_slack_length;
        block.tendon_N_per_m = parameters->tendon_stiffness;
    }
    find_centre(body, attached, parameters->density, &block);
    if (!(block.particles > 0))
        return block;
    block.inertia_kg = block.weight_kg * parameters->mass_scaling;
    add_inertia(body, attached, parameters->density * parameters->mass_scaling, &block);
    invert(block.inertia_kg_m2, block.inverse_inertia);
    return block;
}

/* Motion --------------------------------------------------------------------------------------------------
 */

int sphm_end_follows(const sphm_end_block *block, const sphm_end_drive *drive) {
    return drive->condition == SPHM_END_HELD && !(block->tendon_N_per_m > 0);
}

void sphm_end_follow(const sphm_end_block *block, const sphm_end_motion *motion, double time_s,
                     sphm_end_body *body) {
    sphm_end_state now;
    sphm_end_motion_at(motion, time_s, &now);
    sphm_end_body_follow(block, now.position_m, now.rotation, now.velocity_m_per_s,
                         now.angular_velocity_rad_per_s, body);
}

void sphm_end_block_state(const sphm_end_block *block, const sphm_end_body *body, sphm_end_state *state) {
    double shift[3];
    memcpy(state->rotation, body->rotation, sizeof state->rotation);
    sphm_end_body_spin(block, body->rotation, body->momentum_Nms, state->angular_velocity_rad_per_s);
    sphm_end_body_carry(block, body, state->angular_velocity_rad_per_s, block->point_m, shift,
                        state->velocity_m_per_s);
    for (int d = 0; d < 3; ++d)
        state->position_m[d] = block->point_m[d] + shift[d];
}

void sphm_end_pull_of_bone(const sphm_end_block *block, const sphm_end_motion *motion, double time_s,
                           const sphm_end_body *body, double force_N[3]) {
    sphm_end_state bone, own;
    sphm_end_motion_at(motion, time_s, &bone);
    sphm_end_block_state(block, body, &own);
    sphm_end_tendon_force(block, own.position_m, bone.position_m, force_N);
}

void sphm_end_frame_state(const sphm_end_block *block, const sphm_end_drive *drive, double time_s,
                          const sphm_end_body *body, sphm_end_state *state) {
    if (drive->condition == SPHM_END_HELD) {
        sphm_end_motion_at(&drive->motion, time_s, state);
        return;
    }
    sphm_end_block_state(block, body, state);
    if (!(block->tendon_N_per_m > 0))
        return;
    const double load = sqrt(sphm_dot3(drive->load_N, drive->load_N));
    double along[3];
    sphm_multiply3(body->rotation, block->axis, along);
    for (int d = 0; d < 3; ++d) {
        const double direction = load > 0 ? drive->load_N[d] / load : along[d];
        state->position_m[d] += direction * (block->tendon_slack_m + load / block->tendon_N_per_m);
    }
}

void sphm_end_put_tendon_between(const sphm_end_block *block, const sphm_end_drive *drive, double time_s,
                                 const sphm_end_body *body, sphm_wrench *wrench) {
    if (drive->condition != SPHM_END_HELD || !(block->tendon_N_per_m > 0))
        return;
    sphm_end_pull_of_bone(block, &drive->motion, time_s, body, wrench->force_N);
    for (int d = 0; d < 3; ++d) {
        wrench->force_N[d] = -wrench->force_N[d];
        wrench->moment_Nm[d] = 0;
    }
}
