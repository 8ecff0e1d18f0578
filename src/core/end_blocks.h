/* The rigid blocks at the two ends of a muscle, from its body. */
#ifndef SPHM_CORE_END_BLOCKS_H
#define SPHM_CORE_END_BLOCKS_H

#include "core/drive.h"
#include "kernels/end_block.h"
#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* `end`: SPHM_END_... */
sphm_end_block sphm_end_block_from(const sphm_parameters *parameters, const sphm_body *body, int end);

/* Whether the block is where its drive's motion says: held, without a tendon. Else forces move it. */
int sphm_end_follows(const sphm_end_block *block, const sphm_end_drive *drive);
/* Puts such a block where the motion is at time_s. */
void sphm_end_follow(const sphm_end_block *block, const sphm_end_motion *motion, double time_s,
                     sphm_end_body *body);
/* Force of the tendon on the block from a bone that moves as `motion`. */
void sphm_end_pull_of_bone(const sphm_end_block *block, const sphm_end_motion *motion, double time_s,
                           const sphm_end_body *body, double force_N[3]);
/* Where the block's own frame is: its end of the line of action, and how it moves. */
void sphm_end_block_state(const sphm_end_block *block, const sphm_end_body *body, sphm_end_state *state);
/* Where the end's frame is, which poses and wrenches are about: the block's, or beyond the tendon the bone's.
 * A massless tendon that carries a load hangs in the line of it; a slack one is drawn straight out. */
void sphm_end_frame_state(const sphm_end_block *block, const sphm_end_drive *drive, double time_s,
                          const sphm_end_body *body, sphm_end_state *state);
/* With a tendon between, the bone feels the tendon: at its own point, so without a moment. */
void sphm_end_put_tendon_between(const sphm_end_block *block, const sphm_end_drive *drive, double time_s,
                                 const sphm_end_body *body, sphm_wrench *wrench);

#ifdef __cplusplus
}
#endif
#endif
