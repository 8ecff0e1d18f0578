/* Predicted velocity (20) under gravity and point forces, pulled towards the goal positions of shape matching
 * (21, 23). Reads position, velocity, rest position; writes packs predicted. */
#include <string.h>

#include "cpu/backend.h"
#include "cpu/parallel.h"

/* A point force on the particles within its radius, as an acceleration. */
typedef struct pull {
    sphm_real x, y, z, radius2;
    sphm_real a[3];
} pull;

static int within(const pull *p, const sphm_state *s, size_t i) {
    const sphm_real dx = s->x[i] - p->x, dy = s->y[i] - p->y, dz = s->z[i] - p->z;
    return dx * dx + dy * dy + dz * dz <= p->radius2;
}

/* Shared by mass, and all masses are equal: force over the mass of all the particles within reach. */
static void prepare_pulls(sphm_backend *b, const sphm_drive *drive, pull *pulls) {
    const sphm_model *model = b->model;
    for (size_t f = 0; f < drive->force_count; ++f) {
        const sphm_point_force *force = &drive->forces[f];
        pulls[f].x = (sphm_real)(force->point_m[0] - model->frame_m[0]);
        pulls[f].y = (sphm_real)(force->point_m[1] - model->frame_m[1]);
        pulls[f].z = (sphm_real)(force->point_m[2] - model->frame_m[2]);
        pulls[f].radius2 = (sphm_real)(force->radius_m * force->radius_m);
    }
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

/* g - x of (23), written so that it is exactly 0 on the rest shape:
 * (R - 1)(X - X0) + (x0 - X0) - (x - X), with x0 and X0 the centres. */
typedef struct goal {
    sphm_real turn[9], shift[3], rest_centre[3];
} goal;

static goal make_goal(const sphm_rigid_motion *motion) {
    goal g;
    for (int k = 0; k < 9; ++k)
        g.turn[k] = (sphm_real)(motion->rotation[k] - (k % 4 == 0));
    for (int d = 0; d < 3; ++d) {
        g.shift[d] = (sphm_real)(motion->centre[d] - motion->rest_centre[d]);
        g.rest_centre[d] = (sphm_real)motion->rest_centre[d];
    }
    return g;
}

static void predict_block(sphm_backend *b, const goal *g, sphm_real pull_per_s, const sphm_real drift[3],
                          sphm_real step, const pull *pulls, size_t pull_count, size_t begin, size_t end) {
    const sphm_state *s = &b->state;
    const sphm_real inverse_h = (sphm_real)(1 / b->model->body.support_radius_m);
    for (size_t i = begin; i < end; ++i) {
        sphm_pack *p = &b->packs.predicted[i].first, *v = &b->packs.predicted[i].second;
        p->x = s->x[i] * inverse_h;
        p->y = s->y[i] * inverse_h;
        p->z = s->z[i] * inverse_h;
        p->w = s->density[i];

        const sphm_real rest[3] = {s->rest_x[i], s->rest_y[i], s->rest_z[i]};
        const sphm_real moved[3] = {s->x[i] - rest[0], s->y[i] - rest[1], s->z[i] - rest[2]};
        const sphm_real arm[3] = {rest[0] - g->rest_centre[0], rest[1] - g->rest_centre[1],
                                  rest[2] - g->rest_centre[2]};
        sphm_real u[3] = {s->vx[i] + drift[0], s->vy[i] + drift[1], s->vz[i] + drift[2]};
        for (int d = 0; d < 3; ++d) {
            const sphm_real turned =
                g->turn[3 * d] * arm[0] + g->turn[3 * d + 1] * arm[1] + g->turn[3 * d + 2] * arm[2];
            u[d] += pull_per_s * (turned + g->shift[d] - moved[d]);
        }
        for (size_t f = 0; f < pull_count; ++f)
            if (within(&pulls[f], s, i))
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
    const sphm_fluid_constants *c = &b->model->fluid;
    pull pulls[SPHM_MAX_FORCES];
    memset(pulls, 0, sizeof pulls);
    if (drive->force_count)
        prepare_pulls(b, drive, pulls);
    sphm_cpu_find_rigid_motion(b);
    const goal g = make_goal(&b->motion);
    const sphm_real pull_per_s = (sphm_real)(sphm_shape_matching_coefficient(c, step_s) / step_s);
    sphm_real drift[3];
    for (int d = 0; d < 3; ++d)
        drift[d] = (sphm_real)(step_s * (double)c->gravity_m_per_s2[d]);
#pragma omp parallel for num_threads(b->threads) schedule(static)
    for (size_t block = 0; block < b->blocks; ++block)
        predict_block(b, &g, pull_per_s, drift, (sphm_real)step_s, pulls, drive->force_count,
                      sphm_block_begin(block), sphm_block_end(block, b->state.count));
}
