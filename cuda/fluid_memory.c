/* Memory of the fluid tissue on both sides, and what goes between them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "core/fluid_watch.h"
#include "cuda/fluid_inside.h"
#include "kernels/diffusion.h"

static int bits_for(size_t values) {
    int bits = 1;
    while (bits < 32 && (size_t)1 << bits < values)
        ++bits;
    return bits;
}

void sphm_fluid_set_constants(sphm_fluid_backend *b) {
    const sphm_model *model = b->model;
    const sphm_parameters *p = &model->parameters;
    const double h = model->body.support_radius_m, density = (double)model->fluid.density_kg_per_m3;
    const size_t blocks = (model->body.count + SPHM_FLUID_BLOCK - 1) / SPHM_FLUID_BLOCK;
    sphm_fluid_device *d = &b->fluid;
    d->count = model->body.count;
    d->partials = blocks < SPHM_FLUID_PARTIALS ? (int)blocks : SPHM_FLUID_PARTIALS;
    d->fluid = model->fluid;
    d->membrane = model->membrane;
    d->factors = sphm_force_factors_of(&model->fluid);
    d->kind = sphm_force_kind(&model->fluid, model->fluid.fibre_tension_Pa > 0 &&
                                                 !sphm_fluid_fibres_are_parallel(&model->body));
    d->unit = sphm_smooth_unit(&model->fluid);
    d->inverse_h = (sphm_real)(1 / h);
    d->tension_unit = (sphm_real)(1 / (density * density));
    d->mass_kg = model->particle_mass_kg;
    d->radius_m = h + SPHM_FLUID_SKIN * h;
    d->edge_m = p->cell_size > 0 ? p->cell_size : d->radius_m;
    d->stale_m2 = 0.25 * (SPHM_FLUID_SKIN * h) * (SPHM_FLUID_SKIN * h);
    d->laplacian = p->laplacian;
    d->pair_factor = sphm_pair_factor(model->particle_volume_m3, h);
    d->along = sphm_diffusion_in_h((double)model->membrane.diffusion_mm2_per_ms, h);
    d->across = d->along / (double)model->membrane.anisotropy_ratio;
    d->key_bits = bits_for(sphm_cells_most(d->count));
}

static size_t cut_device(sphm_fluid_device *d, char *memory) {
    const size_t n = d->count, cells = sphm_cells_most(n);
    size_t used = 0;
#define ARRAY(type, name, elements, meaning)                                                                 \
    d->name = (type *)sphm_cut(memory, (elements) * sizeof(type), &used);
#define SORTED(type, name, numbers, meaning)                                                                 \
    d->name = (type *)sphm_cut(memory, (numbers)*n * sizeof(type), &used);                                   \
    d->spare_##name = (type *)sphm_cut(memory, (numbers)*n * sizeof(type), &used);
#include "cuda/fluid_arrays.inc"
    return used;
}

static sphm_status allocate_host(sphm_fluid_backend *b, sphm_context *context) {
    const size_t n = b->model->body.count;
    const sphm_status status = sphm_state_create(&b->state, n, context);
    if (status != SPHM_OK)
        return status;
    b->slots = (int32_t *)malloc(2 * n * sizeof *b->slots);
    b->scratch = malloc(b->state.capacity * SPHM_STATE_ELEMENT_SIZE);
    if (!b->slots || !b->scratch)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to sort %zu particles", n);
    return SPHM_OK;
}

sphm_status sphm_fluid_allocate(sphm_fluid_backend *b, sphm_context *context) {
    sphm_fluid_device *d = &b->fluid;
    void *on_device = NULL, *on_host = NULL;
    size_t used = 0;
    sphm_status status = allocate_host(b, context);
    if (status == SPHM_OK)
        status = b->ops->fluid_scratch(b->device, d, &d->scratch_bytes, context);
    if (status != SPHM_OK)
        return status;
    b->device_bytes = cut_device(d, NULL);
    (void)sphm_cut(NULL, sizeof *b->submission, &used);
    (void)sphm_cut(NULL, sizeof *b->report, &used);
    b->host_bytes = used;
    status = b->ops->allocate(b->device, b->device_bytes, &on_device, context);
    if (status == SPHM_OK)
        status = b->ops->allocate_host(b->device, b->host_bytes, &on_host, context);
    if (status != SPHM_OK)
        return status;
    (void)cut_device(d, (char *)on_device);
    used = 0;
    b->submission = (sphm_fluid_submission *)sphm_cut((char *)on_host, sizeof *b->submission, &used);
    b->report = (sphm_fluid_report *)sphm_cut((char *)on_host, sizeof *b->report, &used);
    return SPHM_OK;
}

void sphm_fluid_free(sphm_fluid_backend *b) {
    sphm_state_free(&b->state);
    free(b->slots);
    free(b->scratch);
}

sphm_status sphm_fluid_reserve_rows(sphm_fluid_backend *b, uint64_t entries, sphm_context *context) {
    sphm_fluid_device *d = &b->fluid;
    const uint64_t capacity = entries + entries / 8; /* the muscle deforms: leave room */
    size_t used = 0;
    void *memory = NULL;
    (void)sphm_cut(NULL, (size_t)capacity * sizeof *d->neighbour, &used);
    (void)sphm_cut(NULL, (size_t)capacity * sizeof *d->weight, &used);
    if (b->rows)
        b->ops->release(b->device, b->rows);
    b->rows = NULL;
    b->kept = 0; /* launches that were kept know the old place */
    d->capacity = 0;
    const sphm_status status = b->ops->allocate(b->device, used, &memory, context);
    if (status != SPHM_OK)
        return status;
    b->rows = memory;
    b->rows_bytes = used;
    used = 0;
    d->neighbour = (int32_t *)sphm_cut((char *)memory, (size_t)capacity * sizeof *d->neighbour, &used);
    d->weight = (sphm_real *)sphm_cut((char *)memory, (size_t)capacity * sizeof *d->weight, &used);
    d->capacity = capacity;
    return SPHM_OK;
}

/* Arrays of three numbers: x, y, z. */
enum { TRIPLES = 5, MOVING_TRIPLES = 3, SINGLES = 6, MOVING_SINGLES = 5 };

static void list_triples(const sphm_fluid_backend *b, sphm_real *device[TRIPLES],
                         sphm_real *host[TRIPLES][3]) {
    const sphm_fluid_device *d = &b->fluid;
    const sphm_state *s = &b->state;
    sphm_real *const on_device[TRIPLES] = {d->position, d->velocity, d->listed, d->rest, d->fibre};
    sphm_real *const on_host[TRIPLES][3] = {{s->x, s->y, s->z},
                                            {s->vx, s->vy, s->vz},
                                            {s->listed_x, s->listed_y, s->listed_z},
                                            {s->rest_x, s->rest_y, s->rest_z},
                                            {s->fibre_x, s->fibre_y, s->fibre_z}};
    memcpy(device, on_device, sizeof on_device);
    memcpy(host, on_host, sizeof on_host);
}

static void list_singles(const sphm_fluid_backend *b, int buffer, sphm_real *device[SINGLES],
                         sphm_real *host[SINGLES]) {
    const sphm_fluid_device *d = &b->fluid;
    const sphm_state *s = &b->state;
    sphm_real *const on_device[SINGLES] = {
        d->density,  d->pressure,   d->potential + (size_t)buffer * d->count,
        d->recovery, d->activation, d->rest_density};
    sphm_real *const on_host[SINGLES] = {s->density,  s->pressure,   s->membrane_potential,
                                         s->recovery, s->activation, s->rest_density};
    memcpy(device, on_device, sizeof on_device);
    memcpy(host, on_host, sizeof on_host);
}

sphm_status sphm_fluid_upload_state(sphm_fluid_backend *b, sphm_context *context) {
    const sphm_fluid_device *d = &b->fluid;
    const sphm_state *s = &b->state;
    const size_t n = s->count, bytes = n * sizeof(sphm_real);
    sphm_copier c = {b->ops, b->device, SPHM_OK, context};
    sphm_real *triples[TRIPLES], *triple_from[TRIPLES][3], *singles[SINGLES], *single_from[SINGLES];
    list_triples(b, triples, triple_from);
    list_singles(b, 0, singles, single_from);
    for (int k = 0; k < TRIPLES; ++k)
        for (size_t a = 0; a < 3; ++a)
            sphm_copy_up(&c, triples[k] + a * n, triple_from[k][a], bytes);
    for (int k = 0; k < SINGLES; ++k)
        sphm_copy_up(&c, singles[k], single_from[k], bytes);
    sphm_copy_up(&c, d->id, s->id, n * sizeof *s->id);
    sphm_copy_up(&c, d->attachment, s->attachment, n);
    sphm_copy_up(&c, d->electrodes, s->electrodes, n);
    sphm_copy_wait(&c);
    b->clock.time_s = s->time_s;
    b->clock.steps = s->steps;
    b->clock.diffusion_due_s = s->diffusion_due_s;
    b->clock.buffer = 0;
    return c.status;
}

/* Puts what is seen into the slots that the particles `id` are in now. */
static void take_slots(sphm_fluid_backend *b, const int32_t *id, int32_t *order) {
    sphm_state *s = &b->state;
    const size_t n = s->count;
    if (memcmp(s->id, id, n * sizeof *id) == 0)
        return;
    int32_t *slot_of = (int32_t *)b->scratch;
    for (size_t slot = 0; slot < n; ++slot)
        slot_of[s->id[slot]] = (int32_t)slot;
    for (size_t slot = 0; slot < n; ++slot)
        order[slot] = slot_of[id[slot]];
    sphm_state_permute(s, order, b->scratch);
}

sphm_status sphm_fluid_download_state(sphm_fluid_backend *b, sphm_context *context) {
    sphm_state *s = &b->state;
    const size_t n = s->count, bytes = n * sizeof(sphm_real);
    sphm_copier c = {b->ops, b->device, SPHM_OK, context};
    sphm_real *triples[TRIPLES], *triple_to[TRIPLES][3], *singles[SINGLES], *single_to[SINGLES];
    sphm_copy_down(&c, b->slots, b->fluid.id, n * sizeof *b->slots);
    sphm_copy_wait(&c);
    if (c.status != SPHM_OK)
        return c.status;
    take_slots(b, b->slots, b->slots + n);
    list_triples(b, triples, triple_to);
    list_singles(b, b->clock.buffer, singles, single_to);
    for (int k = 0; k < MOVING_TRIPLES; ++k)
        for (size_t a = 0; a < 3; ++a)
            sphm_copy_down(&c, triple_to[k][a], triples[k] + a * n, bytes);
    for (int k = 0; k < MOVING_SINGLES; ++k)
        sphm_copy_down(&c, single_to[k], singles[k], bytes);
    sphm_copy_wait(&c);
    return c.status;
}
