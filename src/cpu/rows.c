/* Keeping slot order, neighbour rows and diffusion weights up to date. */
#include <math.h>
#include <string.h>

#include "cpu/backend.h"
#include "cpu/membrane.h"

static double cell_edge(const sphm_backend *b, double radius) {
    return b->model->parameters.cell_size > 0 ? b->model->parameters.cell_size : radius;
}

/* The rest shape in the order of the slots, in units of h as the sweeps have positions. */
static void pack_rest_shape(sphm_backend *b) {
    const sphm_state *s = &b->state;
    const sphm_real inverse_h = (sphm_real)(1 / b->model->body.support_radius_m);
    for (size_t i = 0; i < s->count; ++i) {
        sphm_pack *rest = &b->packs.smoothed[i].third;
        rest->x = s->rest_x[i] * inverse_h;
        rest->y = s->rest_y[i] * inverse_h;
        rest->z = s->rest_z[i] * inverse_h;
    }
}

sphm_status sphm_cpu_build_rows(sphm_backend *b, sphm_context *context) {
    sphm_state *s = &b->state;
    const double radius = b->model->body.support_radius_m + b->skin_m;
    sphm_status status = sphm_grid_sort(&b->grid, s->listed_x, s->listed_y, s->listed_z, s->id, s->count,
                                        cell_edge(b, radius), context);
    if (status != SPHM_OK)
        return status;
    /* The packs are rewritten before they are read again: one array of them is scratch here. */
    sphm_state_permute(s, b->grid.order, b->packs.predicted);
    pack_rest_shape(b);
    status = sphm_neighbours_build(&b->rows, &b->grid, s->listed_x, s->listed_y, s->listed_z, s->count,
                                   radius, b->threads, context);
    if (status == SPHM_OK)
        status = sphm_cpu_build_diffusion(&b->diffusion, &b->rows, b->model, s, b->threads, context);
    return status;
}

sphm_status sphm_cpu_refresh_rows(sphm_backend *b, sphm_context *context) {
    if (!b->rows_stale)
        return SPHM_OK;
    sphm_state *s = &b->state;
    const size_t bytes = s->count * sizeof(sphm_real);
    memcpy(s->listed_x, s->x, bytes);
    memcpy(s->listed_y, s->y, bytes);
    memcpy(s->listed_z, s->z, bytes);
    const sphm_status status = sphm_cpu_build_rows(b, context);
    b->rows_stale = status != SPHM_OK;
    ++b->timing.neighbour_rebuilds;
    return status;
}
