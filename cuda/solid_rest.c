/* See solid_rest.h. */
#include "cuda/solid_rest.h"

#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "core/threads.h"
#include "cpu/grid.h"
#include "cpu/membrane.h"
#include "cpu/neighbours.h"

/* The rest state in cell order; `grid` is left sorted. */
static sphm_status fill_state(sphm_solid_rest *rest, sphm_grid *grid, const sphm_model *model,
                              sphm_context *context) {
    sphm_state *s = &rest->state;
    sphm_status status = sphm_state_create(s, model->body.count, context);
    if (status != SPHM_OK)
        return status;
    sphm_model_rest_state(model, s);
    memcpy(s->rest_density, s->density, s->count * sizeof *s->density);
    void *scratch = malloc(s->capacity * SPHM_STATE_ELEMENT_SIZE);
    if (!scratch)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to sort %zu particles", s->count);
    status = sphm_grid_sort(grid, s->x, s->y, s->z, s->id, s->count, model->body.support_radius_m, context);
    if (status == SPHM_OK)
        sphm_state_permute(s, grid->order, scratch);
    free(scratch);
    return status;
}

static sphm_status build_operators(sphm_solid_rest *rest, const sphm_grid *grid, const sphm_model *model,
                                   sphm_context *context) {
    const sphm_state *s = &rest->state;
    const double radius = model->body.support_radius_m;
    const int threads = sphm_team_size(model->parameters.threads);
    sphm_status status =
        sphm_neighbours_build(&rest->rows, grid, s->x, s->y, s->z, s->count, radius, threads, context);
    if (status == SPHM_OK)
        status = sphm_gradient_create(&rest->gradient, &rest->rows, s->x, s->y, s->z, s->relative_volume,
                                      radius, model->particle_volume_m3, threads, context);
    if (status == SPHM_OK)
        status = sphm_cpu_build_diffusion(&rest->diffusion, &rest->rows, model, s, threads, context);
    if (status == SPHM_OK && rest->gradient.regularised + rest->gradient.isolated)
        sphm_log(context, SPHM_LOG_WARNING,
                 "%zu of %zu particles have neighbours in a plane only and %zu have none: a larger "
                 "smoothing_ratio or more particles would give them some",
                 rest->gradient.regularised, s->count, rest->gradient.isolated);
    return status;
}

sphm_status sphm_solid_rest_create(sphm_solid_rest *rest, const sphm_model *model, sphm_context *context) {
    sphm_grid grid;
    memset(rest, 0, sizeof *rest);
    memset(&grid, 0, sizeof grid);
    sphm_status status = fill_state(rest, &grid, model, context);
    if (status == SPHM_OK)
        status = build_operators(rest, &grid, model, context);
    sphm_grid_free(&grid);
    if (status != SPHM_OK)
        sphm_solid_rest_free(rest);
    return status;
}

void sphm_solid_rest_drop_arrays(sphm_solid_rest *rest) {
    const sphm_gradient gradient = rest->gradient;
    const double stable_step_ms = rest->diffusion.stable_step_ms;
    sphm_neighbours_free(&rest->rows);
    sphm_gradient_free(&rest->gradient);
    sphm_diffusion_free(&rest->diffusion);
    rest->gradient = gradient;
    rest->gradient.pair = rest->gradient.correction = NULL;
    rest->diffusion.stable_step_ms = stable_step_ms;
}

void sphm_solid_rest_free(sphm_solid_rest *rest) {
    sphm_state_free(&rest->state);
    sphm_neighbours_free(&rest->rows);
    sphm_gradient_free(&rest->gradient);
    sphm_diffusion_free(&rest->diffusion);
    memset(rest, 0, sizeof *rest);
}
