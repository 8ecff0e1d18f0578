/* Predicted velocity (20) under gravity and point forces, pulled towards the goal positions of shape matching
 * (21, 23). Reads position, velocity, rest position; writes packs predicted. */
#include <string.h>

#include "cpu/backend.h"
#include "cpu/parallel.h"

static int within(const sphm_point_pull *p, const sphm_state *s, size_t i) {
    const sphm_real x[3] = {s->x[i], s->y[i], s->z[i]};
    return sphm_point_pull_reaches(p, x);
}

/* Shared by mass, and all masses are equal: force over the mass of all the particles within reach. */
static void prepare_pulls(sphm_backend *b, const sphm_drive *drive, sphm_point_pull *pulls) {
    const sphm_model *model = b->model;
    for (size_t f = 0; f < drive->force_count; ++f)
        pulls[f] = sphm_point_pull_at(drive->forces[f].point_m, drive->forces[f].radius_m, model->frame_m);
#pragma omp parallel for num_threads(b->threads) schedule(static)
    for (size_t block = 0; block < b->blocks; ++block)
        for (size_t f = 0; f < drive->force_count; ++f) {
            size_t pulled = 0;
            for (size_t i = sphm_block_begin(block); i < sphm_block_end(block, b->state.count); ++i)
                pulled += (size_t)within(&pulls[f], &b->state, i);
            b->results[block].pulled[f] = pulled;
        }
    for (size_t f = 0; f < drive->force_count; ++f) {
        size_t pulled = 0;
        for (size_t block = 0; block < b->blocks; ++block)
            pulled += b->results[block].pulled[f];
        for (int d = 0; d < 3; ++d)
            pulls[f].a[d] =
                pulled ? (sphm_real)(drive->forces[f].force_N[d] / ((double)pulled * model->particle_mass_kg))
                       : 0;
    }
}

static void predict_block(sphm_backend *b, const sphm_goal *g, const sphm_prediction *prediction,
                          sphm_real step, const sphm_point_pull *pulls, size_t pull_count, size_t begin,
                          size_t end) {
    const sphm_state *s = &b->state;
    const sphm_real inverse_h = (sphm_real)(1 / b->model->body.support_radius_m);
    for (size_t i = begin; i < end; ++i) {
        sphm_pack *p = &b->packs.predicted[i].first, *v = &b->packs.predicted[i].second;
        p->x = s->x[i] * inverse_h;
        p->y = s->y[i] * inverse_h;
        p->z = s->z[i] * inverse_h;
        p->w = s->density[i];

        const sphm_real x[3] = {s->x[i], s->y[i], s->z[i]}, before[3] = {s->vx[i], s->vy[i], s->vz[i]};
        const sphm_real rest[3] = {s->rest_x[i], s->rest_y[i], s->rest_z[i]};
        sphm_real u[3];
        sphm_fluid_predict(prediction, g, x, before, rest, u);
        for (size_t f = 0; f < pull_count; ++f)
            if (sphm_point_pull_reaches(&pulls[f], x))
                for (int d = 0; d < 3; ++d)
                    u[d] += step * pulls[f].a[d];
        const sphm_real free = s->attachment[i] == SPHM_FREE;
        v->x = free > 0 ? u[0] : 0;
        v->y = free > 0 ? u[1] : 0;
        v->z = free > 0 ? u[2] : 0;
        v->w = 0;
    }
}

void sphm_cpu_predict(sphm_backend *b, double step_s, const sphm_drive *drive) {
    sphm_point_pull pulls[SPHM_MAX_FORCES];
    memset(pulls, 0, sizeof pulls);
    if (drive->force_count)
        prepare_pulls(b, drive, pulls);
    sphm_cpu_find_rigid_motion(b);
    const sphm_goal g = sphm_goal_of(&b->motion);
    const sphm_prediction prediction = sphm_prediction_of(&b->model->fluid, step_s);
#pragma omp parallel for num_threads(b->threads) schedule(static)
    for (size_t block = 0; block < b->blocks; ++block)
        predict_block(b, &g, &prediction, (sphm_real)step_s, pulls, drive->force_count,
                      sphm_block_begin(block), sphm_block_end(block, b->state.count));
}
