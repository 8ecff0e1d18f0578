/* See solid_plan.h. */
#include "cuda/solid_plan.h"

#include <math.h>
#include <string.h>

#include "core/end_blocks.h"

/* An end that follows its pose is where it is after the step; for another only what pulls at it is known. */
static void plan_end(sphm_solid_end *plan, const sphm_model *model, const sphm_end_drive *drive, int end,
                     double step_s, sphm_solid_clock *clock) {
    const sphm_end_block *block = &model->ends[end];
    if (sphm_end_follows(block, drive)) {
        if (block->particles > 0)
            sphm_end_follow(block, &drive->motion, clock->time_s + step_s, &clock->ends[end]);
        sphm_end_frame_of(block, &clock->ends[end], model->frame_m, &plan->frame);
        return;
    }
    plan->moved_by = drive->condition == SPHM_END_SLIDING ? SPHM_SOLID_SLIDES : SPHM_SOLID_PULLED;
    memcpy(plan->load_N, drive->load_N, sizeof plan->load_N);
    if (drive->condition == SPHM_END_HELD) {
        sphm_end_state bone;
        sphm_end_motion_at(&drive->motion, clock->time_s, &bone);
        memcpy(plan->bone_m, bone.position_m, sizeof plan->bone_m);
        plan->tendon = 1;
    }
}

static sphm_solid_mover mover_of(const sphm_model *model, double step_s) {
    const sphm_parameters *p = &model->parameters;
    sphm_solid_mover m;
    m.kick = (sphm_real)(step_s / (model->particle_mass_kg * p->mass_scaling));
    m.keep = (sphm_real)exp(-p->velocity_damping * step_s);
    m.step = (sphm_real)step_s;
    for (int d = 0; d < 3; ++d)
        m.gravity[d] = (sphm_real)(step_s * p->gravity[d] / p->mass_scaling);
    return m;
}

void sphm_solid_plan_drive(sphm_solid_submission *s, const sphm_model *model, const sphm_drive *drive,
                           const sphm_solid_clock *clock) {
    memset(s, 0, sizeof *s);
    s->failure = SPHM_SOLID_FINE;
    memcpy(s->ends, clock->ends, sizeof s->ends);
    s->electrodes = sphm_membrane_tabulate(&model->membrane, drive);
    s->pull_count = (uint32_t)drive->force_count;
    for (size_t f = 0; f < drive->force_count; ++f) {
        const sphm_point_force *force = &drive->forces[f];
        sphm_solid_pull *pull = &s->pulls[f];
        pull->radius_m = force->radius_m;
        for (int d = 0; d < 3; ++d) {
            pull->centre_m[d] = force->point_m[d] - model->frame_m[d];
            pull->force_N[d] = force->force_N[d];
        }
    }
}

void sphm_solid_plan_step(sphm_solid_plan *plan, const sphm_model *model, const sphm_drive *drive,
                          double stable_step_ms, double step_s, sphm_solid_clock *clock) {
    const sphm_membrane_constants *c = &model->membrane;
    memset(plan, 0, sizeof *plan);
    plan->mover = mover_of(model, step_s);
    plan->step_s = step_s;
    plan->keep = exp(-model->parameters.velocity_damping * step_s);
    if (model->parameters.force_velocity == SPHM_FORCE_VELOCITY_HILL)
        plan->rate_share = (sphm_real)-expm1(-step_s / model->parameters.rate_filter);
    plan->commanded = drive->activation_commanded;
    if (plan->commanded) { /* the diffusion that is due stays due */
        sphm_membrane_plan_filter(&plan->membrane, c, step_s);
        plan->membrane.buffer = clock->buffer;
        plan->target = (sphm_real)drive->activation;
    } else {
        sphm_membrane_plan_step(&plan->membrane, c, stable_step_ms, step_s, &clock->diffusion_due_s,
                                &clock->buffer);
    }
    for (int end = 0; end < SPHM_END_COUNT; ++end)
        plan_end(&plan->ends[end], model, &drive->ends[end], end, step_s, clock);
    clock->time_s += step_s;
    ++clock->steps;
}

void sphm_solid_plan_nothing(sphm_solid_plan *plan, int buffer) {
    memset(plan, 0, sizeof *plan);
    plan->commanded = 1; /* the membrane stands still, and with no rise and fall so does the activation */
    plan->membrane.buffer = buffer;
}
