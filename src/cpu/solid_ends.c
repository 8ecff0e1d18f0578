/* Ends of the solid tissue; see solid_ends.h. Blocks are moved one after the other and their particles are
 * summed in slot order: a tenth of the particles each, for a few additions. */
#include "cpu/solid_ends.h"

#include <math.h>
#include <string.h>

#include "core/end_blocks.h"

void sphm_solid_sum_end(const sphm_state *state, sphm_real *const force[3], int end, const double pivot[3],
                        double force_N[3], double moment_Nm[3]) {
    const uint8_t attached = end == SPHM_END_ORIGIN ? SPHM_ATTACHED_ORIGIN : SPHM_ATTACHED_INSERTION;
    memset(force_N, 0, 3 * sizeof *force_N);
    memset(moment_Nm, 0, 3 * sizeof *moment_Nm);
    for (size_t i = 0; i < state->count; ++i) {
        if (state->attachment[i] != attached)
            continue;
        const double arm[3] = {(double)state->x[i] - pivot[0], (double)state->y[i] - pivot[1],
                               (double)state->z[i] - pivot[2]};
        const double f[3] = {(double)force[0][i], (double)force[1][i], (double)force[2][i]};
        double moment[3];
        sphm_cross3(arm, f, moment);
        for (int d = 0; d < 3; ++d) {
            force_N[d] += f[d];
            moment_Nm[d] += moment[d];
        }
    }
}

/* The tissue moves the block, and what pulls at the end of the line of action: a load, or a bone through a
 * tendon. */
static void move_block(const sphm_model *model, sphm_state *state, sphm_real *const force[3],
                       const sphm_end_drive *drive, int end, double step_s) {
    const sphm_end_block *block = &model->ends[end];
    const sphm_parameters *p = &model->parameters;
    sphm_end_body *body = &state->ends[end];
    const double keep = exp(-p->velocity_damping * step_s);
    double centre[3], force_N[3], moment_Nm[3], pull_N[3];
    for (int d = 0; d < 3; ++d) {
        centre[d] = block->centre_m[d] + body->shift_m[d] - model->frame_m[d];
        pull_N[d] = drive->load_N[d];
    }
    sphm_solid_sum_end(state, force, end, centre, force_N, moment_Nm);
    if (drive->condition == SPHM_END_HELD)
        sphm_end_pull_of_bone(block, &drive->motion, state->time_s, body, pull_N);
    if (drive->condition == SPHM_END_SLIDING)
        sphm_end_body_slide(block, force_N, pull_N, p->gravity, step_s, keep, body);
    else
        sphm_end_body_step(block, force_N, moment_Nm, pull_N, p->gravity, step_s, keep, body);
}

sphm_end_frame sphm_solid_move_end(const sphm_model *model, sphm_state *state, sphm_real *const force[3],
                                   const sphm_end_drive *drive, int end, double step_s) {
    const sphm_end_block *block = &model->ends[end];
    if (block->particles > 0) {
        if (sphm_end_follows(block, drive))
            sphm_end_follow(block, &drive->motion, state->time_s + step_s, &state->ends[end]);
        else
            move_block(model, state, force, drive, end, step_s);
    }
    sphm_end_frame frame;
    sphm_end_frame_of(block, &state->ends[end], model->frame_m, &frame);
    return frame;
}
