/* The solid tissue on the CPU: memory, and the order of a step.
 *
 *     force sweep | integrate, ends | membrane -> activation | stress sweep
 *
 * Leap-frog: positions at the steps, velocities half a step behind. Slots are sorted into cells once, at
 * creation, and stay: the rows are those of the rest shape. Equations in doc/solid.md. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/backend.h"
#include "core/context.h"
#include "core/end_blocks.h"
#include "core/gradient.h"
#include "core/solid_limits.h"
#include "cpu/grid.h"
#include "cpu/membrane.h"
#include "cpu/neighbours.h"
#include "cpu/parallel.h"
#include "cpu/solid_integrate.h"
#include "cpu/solid_ends.h"
#include "cpu/solid_sweeps.h"
#include "kernels/vector.h"

typedef struct solid_backend {
    const sphm_model *model;
    sphm_state state;
    sphm_grid grid;
    sphm_neighbours rows;
    sphm_gradient gradient;
    sphm_diffusion diffusion;
    sphm_column_diffusion column_diffusion; /* in use where lines.columns is */
    sphm_solid_lines lines;
    sphm_solid_field field;
    sphm_solid_attached attached;
    int32_t *block_nonfinite; /* [blocks]: first slot that is not finite, or -1 */
    double *spare_modulus;    /* [lines.blocks] and */
    int32_t *spare_inverted;  /* [lines.blocks]: for sweeps that are not part of a step */
    int threads;
    sphm_timing timing;
    char device[64];
} solid_backend;

static solid_backend *inside(sphm_backend *backend) {
    return (solid_backend *)backend;
}
static const solid_backend *look_inside(const sphm_backend *backend) {
    return (const solid_backend *)backend;
}

/* Creation -------------------------------------------------------------------------------------------------
 */

static void destroy(sphm_backend *backend) {
    solid_backend *b = inside(backend);
    if (!b)
        return;
    sphm_state_free(&b->state);
    sphm_grid_free(&b->grid);
    sphm_neighbours_free(&b->rows);
    sphm_gradient_free(&b->gradient);
    sphm_diffusion_free(&b->diffusion);
    sphm_column_diffusion_free(&b->column_diffusion);
    sphm_solid_lines_free(&b->lines);
    sphm_solid_attached_free(&b->attached);
    free(b->block_nonfinite);
    free(b->spare_modulus);
    free(b->spare_inverted);
    free(b);
}

/* The rest state by particle id, then in cell order. */
static sphm_status fill_rest(solid_backend *b, sphm_context *context) {
    const sphm_model *model = b->model;
    const sphm_body *body = &model->body;
    sphm_state *s = &b->state;
    sphm_model_rest_state(model, s);
    memcpy(s->rest_density, s->density, s->count * sizeof *s->density);
    void *scratch = malloc(s->capacity * SPHM_STATE_ELEMENT_SIZE);
    if (!scratch)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to sort %zu particles", s->count);
    const sphm_status status =
        sphm_grid_sort(&b->grid, s->x, s->y, s->z, s->id, s->count, body->support_radius_m, context);
    if (status == SPHM_OK)
        sphm_state_permute(s, b->grid.order, scratch);
    free(scratch);
    return status;
}

/* On a lattice the slots follow its rows. */
static sphm_status follow_lattice(solid_backend *b, sphm_lattice *lattice, sphm_context *context) {
    sphm_state *s = &b->state;
    const sphm_real *const position[3] = {s->x, s->y, s->z};
    sphm_status status = sphm_lattice_find(lattice, &b->rows, position, context);
    if (status != SPHM_OK || !lattice->site)
        return status;
    int32_t *order = b->grid.order; /* done with */
    void *scratch = malloc(s->capacity * SPHM_STATE_ELEMENT_SIZE + 3 * s->count * sizeof(int32_t));
    if (!scratch)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to sort %zu particles", s->count);
    status = sphm_lattice_order(lattice, order, context);
    if (status == SPHM_OK)
        status = sphm_neighbours_reorder(&b->rows, order, context);
    if (status == SPHM_OK) {
        sphm_lattice_permute(lattice, order, (int32_t *)scratch);
        sphm_state_permute(s, order, scratch);
    }
    free(scratch);
    return status;
}

static sphm_status build_operators(solid_backend *b, sphm_context *context) {
    const sphm_state *s = &b->state;
    sphm_lattice lattice;
    memset(&lattice, 0, sizeof lattice);
    const double radius = b->model->body.support_radius_m;
    sphm_status status =
        sphm_neighbours_build(&b->rows, &b->grid, s->x, s->y, s->z, s->count, radius, b->threads, context);
    if (status == SPHM_OK)
        status = sphm_gradient_create(&b->gradient, &b->rows, s->x, s->y, s->z, s->relative_volume, radius,
                                      b->model->particle_volume_m3, b->threads, context);
    if (status == SPHM_OK)
        status = follow_lattice(b, &lattice, context);
    if (status == SPHM_OK && lattice.site)
        status = sphm_gradient_rebuild(&b->gradient, &b->rows, s->x, s->y, s->z, radius,
                                       b->model->particle_volume_m3, b->threads, context);
    if (status == SPHM_OK)
        status = sphm_cpu_build_diffusion(&b->diffusion, &b->rows, b->model, s, b->threads, context);
    if (status == SPHM_OK)
        status =
            sphm_solid_lines_create(&b->lines, &b->rows, &b->gradient, s->x, s->y, s->z, &lattice, context);
    sphm_lattice_free(&lattice);
    if (status == SPHM_OK && b->lines.columns.slice)
        status = sphm_column_diffusion_create(&b->column_diffusion, &b->lines.columns, &b->rows,
                                              &b->diffusion, context);
    if (status == SPHM_OK && b->gradient.regularised + b->gradient.isolated)
        sphm_log(context, SPHM_LOG_WARNING,
                 "%zu of %zu particles have neighbours in a plane only and %zu have none: a larger "
                 "smoothing_ratio or more particles would give them some",
                 b->gradient.regularised, s->count, b->gradient.isolated);
    return status;
}

static void set_field(solid_backend *b) {
    const sphm_parameters *p = &b->model->parameters;
    sphm_state *s = &b->state;
    sphm_solid_field *f = &b->field;
    f->fibre_x = s->fibre_x;
    f->fibre_y = s->fibre_y;
    f->fibre_z = s->fibre_z;
    f->activation = s->activation;
    f->relative_volume = s->relative_volume;
    const sphm_real *motion[6] = {s->shift_x, s->shift_y, s->shift_z, s->vx, s->vy, s->vz};
    memcpy(f->shift, motion, sizeof f->shift);
    memcpy(f->velocity, motion + 3, sizeof f->velocity);
    f->density = s->density;
    f->pressure = s->pressure;
    f->fibre_rate = p->force_velocity == SPHM_FORCE_VELOCITY_HILL ? s->fibre_rate : NULL;
    f->constants = b->model->solid;
    f->viscosity_Pa_s = (sphm_real)p->tissue_viscosity;
    f->hourglass_Pa = (sphm_real)p->hourglass_stiffness;
    /* The same viscosity for what gradients see and what they do not. */
    f->hourglass_time_s =
        (sphm_real)(p->hourglass_stiffness > 0 ? p->tissue_viscosity / p->hourglass_stiffness : 0);
    f->particle_volume_m3 = (sphm_real)b->model->particle_volume_m3;
    f->density_kg_per_m3 = (sphm_real)p->density;
    f->threads = b->threads;
}

static sphm_status build(solid_backend *b, sphm_context *context) {
    sphm_status status = sphm_state_create(&b->state, b->model->body.count, context);
    if (status == SPHM_OK)
        status = fill_rest(b, context);
    if (status == SPHM_OK)
        status = build_operators(b, context);
    if (status != SPHM_OK)
        return status;
    const size_t blocks = sphm_block_count(b->state.count);
    b->block_nonfinite = (int32_t *)malloc(blocks * sizeof *b->block_nonfinite);
    b->spare_modulus = (double *)malloc(b->lines.blocks * sizeof *b->spare_modulus);
    b->spare_inverted = (int32_t *)malloc(b->lines.blocks * sizeof *b->spare_inverted);
    if (!b->block_nonfinite || !b->spare_modulus || !b->spare_inverted)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the solid tissue");
    status = sphm_solid_attached_create(&b->attached, &b->state, context);
    if (status != SPHM_OK)
        return status;
    set_field(b);
    sphm_solid_stress_sweep(&b->field, &b->lines);
    b->timing.neighbours_per_particle = b->gradient.neighbours_per_particle;
    return SPHM_OK;
}

static sphm_status create(const sphm_model *model, sphm_backend **backend, sphm_context *context) {
    *backend = NULL;
    solid_backend *b = (solid_backend *)calloc(1, sizeof *b);
    if (!b)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the CPU back end");
    b->model = model;
    b->threads = sphm_team_size(model->parameters.threads);
    snprintf(b->device, sizeof b->device, "cpu, %d thread%s", b->threads, b->threads == 1 ? "" : "s");
    const sphm_status status = build(b, context);
    if (status != SPHM_OK) {
        destroy((sphm_backend *)b);
        return status;
    }
    *backend = (sphm_backend *)b;
    return SPHM_OK;
}

/* A step ---------------------------------------------------------------------------------------------------
 */

static void activate(solid_backend *b, const sphm_drive *drive, double step_s) {
    if (!drive->activation_commanded && b->column_diffusion.columns) {
        sphm_cpu_membrane_step_columns(&b->state, &b->column_diffusion, b->diffusion.stable_step_ms,
                                       &b->model->membrane, drive, step_s, b->threads, &b->timing);
        return;
    }
    if (!drive->activation_commanded) {
        sphm_cpu_membrane_step(&b->state, &b->rows, &b->diffusion, &b->model->membrane, drive, step_s,
                               b->threads, &b->timing);
        return;
    }
    const sphm_membrane_constants *c = &b->model->membrane;
    const sphm_real rise = (sphm_real)-expm1(-step_s * 1e3 / (double)c->activation_ms);
    const sphm_real fall = (sphm_real)-expm1(-step_s * 1e3 / (double)c->deactivation_ms);
    for (size_t i = 0; i < b->state.count; ++i)
        b->state.activation[i] =
            sphm_activation_filter(b->state.activation[i], (sphm_real)drive->activation, rise, fall);
}

static int within(const sphm_state *s, size_t i, const double centre[3], double radius) {
    const double d[3] = {(double)s->x[i] - centre[0], (double)s->y[i] - centre[1],
                         (double)s->z[i] - centre[2]};
    return sphm_dot3(d, d) <= radius * radius;
}

/* External forces, shared by the particles within their radius. */
static void add_point_forces(solid_backend *b, const sphm_drive *drive) {
    const sphm_state *s = &b->state;
    for (size_t f = 0; f < drive->force_count; ++f) {
        const sphm_point_force *pull = &drive->forces[f];
        double centre[3];
        size_t hit = 0;
        for (int d = 0; d < 3; ++d)
            centre[d] = pull->point_m[d] - b->model->frame_m[d];
        for (size_t i = 0; i < s->count; ++i)
            hit += (size_t)within(s, i, centre, pull->radius_m);
        for (size_t i = 0; hit && i < s->count; ++i)
            if (within(s, i, centre, pull->radius_m))
                for (int d = 0; d < 3; ++d)
                    b->lines.force[d][i] += (sphm_real)(pull->force_N[d] / (double)hit);
    }
}

static int32_t first_bad_potential(const sphm_state *s) {
    for (size_t i = 0; i < s->count; ++i)
        if (!isfinite(s->membrane_potential[i]) || !isfinite(s->recovery[i]))
            return s->id[i];
    return -1;
}

/* What is wrong with a slot, unless the membrane is the cause. */
static sphm_status report(const solid_backend *b, int32_t slot, const char *what, const char *stage,
                          sphm_context *context) {
    const int32_t excited = first_bad_potential(&b->state);
    const int by_membrane = excited >= 0;
    return sphm_fail(context, SPHM_FAILED_NONFINITE, "particle %d is %s at %g s (%s, step %llu)",
                     (int)(by_membrane ? excited : b->state.id[slot]), by_membrane ? "not finite" : what,
                     b->state.time_s, by_membrane ? "membrane" : stage, (unsigned long long)b->state.steps);
}

/* Inverted particles come first: they are why the others are not finite. */
static sphm_status check(const solid_backend *b, sphm_context *context) {
    const size_t blocks = sphm_block_count(b->state.count);
    for (size_t block = 0; block < b->lines.blocks; ++block)
        if (b->lines.block_inverted[block] >= 0)
            return report(b, b->lines.block_inverted[block], "turned inside out", "stress sweep", context);
    for (size_t block = 0; block < blocks; ++block)
        if (b->block_nonfinite[block] >= 0)
            return report(b, b->block_nonfinite[block], "not finite", "integration", context);
    return SPHM_OK;
}

/* Adds the time since *since to *sum, and starts anew. */
static void clock_lap(double *since, double *sum) {
    const double now = sphm_wall_clock_s();
    *sum += now - *since;
    *since = now;
}

/* Between steps the lines hold the stress of the present state, so that limits, density and pressure are a
 * function of the state alone: a restored muscle takes the same steps. */
static sphm_status step_once(solid_backend *b, double step_s, const sphm_drive *drive,
                             sphm_context *context) {
    sphm_timing *t = &b->timing;
    const double start = sphm_wall_clock_s();
    double lap = start;
    sphm_solid_force_sweep(&b->field, &b->lines);
    add_point_forces(b, drive);
    clock_lap(&lap, &t->forces_s);
    sphm_solid_integrate(b->model, &b->state, b->lines.force, &b->attached, drive, step_s, b->threads,
                         b->block_nonfinite);
    clock_lap(&lap, &t->integration_s);
    activate(b, drive, step_s);
    lap = sphm_wall_clock_s();
    b->field.rate_share =
        b->field.fibre_rate ? (sphm_real)-expm1(-step_s / b->model->parameters.rate_filter) : 0;
    sphm_solid_stress_sweep(&b->field, &b->lines);
    b->field.rate_share = 0; /* sweeps that are not part of a step leave the rate alone */
    clock_lap(&lap, &t->density_pressure_s);
    b->state.time_s += step_s;
    ++b->state.steps;
    ++t->steps;
    t->total_s += lap - start;
    return check(b, context);
}

static sphm_status step(sphm_backend *backend, size_t count, double time_step_s, const sphm_drive *drive,
                        sphm_context *context) {
    for (size_t k = 0; k < count; ++k) {
        const sphm_status status = step_once(inside(backend), time_step_s, drive, context);
        if (status != SPHM_OK)
            return status;
    }
    return SPHM_OK;
}

/* State, limits, wrench ------------------------------------------------------------------------------------
 */

static const sphm_state *view(sphm_backend *backend) {
    return &inside(backend)->state;
}

static const sphm_state *clock_of(const sphm_backend *backend) {
    return &look_inside(backend)->state;
}

/* `from` in any slot order; the slots here stay as they are. */
static sphm_status restore(sphm_backend *backend, const sphm_state *from, sphm_context *context) {
    solid_backend *b = inside(backend);
    sphm_state *s = &b->state, by_id;
    int32_t *slots = (int32_t *)malloc(s->count * sizeof *slots);
    void *scratch = malloc(s->capacity * SPHM_STATE_ELEMENT_SIZE);
    sphm_status status = sphm_state_create(&by_id, s->count, context);
    if (status == SPHM_OK && (!slots || !scratch))
        status = sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to restore %zu particles", s->count);
    if (status == SPHM_OK)
        status = sphm_state_load_by_id(from, &by_id, slots, context);
    if (status == SPHM_OK) {
        memcpy(slots, s->id, s->count * sizeof *slots);
        sphm_state_permute(&by_id, slots, scratch);
        sphm_state_copy_scalars(&by_id, s);
#define STATE(type, name) memcpy(s->name, by_id.name, s->count * sizeof(type));
#define REST(type, name)
#define SCRATCH(type, name)
#define ARRAY(type, name, role, unit, meaning) role(type, name)
#include "core/state_arrays.inc"
#undef ARRAY
#undef STATE
#undef REST
#undef SCRATCH
    }
    if (status == SPHM_OK)
        sphm_solid_stress_sweep(&b->field, &b->lines);
    sphm_state_free(&by_id);
    free(slots);
    free(scratch);
    return status;
}

static sphm_time_step_limits limits(const sphm_backend *backend) {
    const solid_backend *b = look_inside(backend);
    double modulus = 0;
    for (size_t block = 0; block < b->lines.blocks; ++block)
        modulus = fmax(modulus, b->lines.block_modulus_Pa[block]);
    return sphm_solid_limits(b->model, &b->gradient, modulus);
}

static size_t memory_bytes(const solid_backend *b) {
    const size_t n = b->state.count, pairs = b->rows.row_start[n];
    return sizeof *b + sphm_state_bytes(n) + sphm_solid_lines_bytes(&b->lines) +
           sphm_column_diffusion_bytes(&b->column_diffusion) + 6 * n * sizeof(sphm_real) +
           4 * pairs * sizeof(sphm_real) + (b->rows.capacity + n) * sizeof(int32_t) +
           (n + 1) * sizeof(size_t) + b->diffusion.capacity * sizeof(sphm_real) +
           SPHM_DIFFUSION_SCRATCH * b->diffusion.particles * sizeof *b->diffusion.scratch +
           (b->grid.capacity + 1 + 2 * b->grid.particles) * sizeof(int32_t);
}

static sphm_timing timing(const sphm_backend *backend) {
    sphm_timing t = look_inside(backend)->timing;
    t.memory_bytes = memory_bytes(look_inside(backend));
    return t;
}

static void reset_timing(sphm_backend *backend) {
    solid_backend *b = inside(backend);
    memset(&b->timing, 0, sizeof b->timing);
    b->timing.neighbours_per_particle = b->gradient.neighbours_per_particle;
}

static const char *device(const sphm_backend *backend) {
    return look_inside(backend)->device;
}

/* Lines of the present motion with part of the stress. What a step left behind for the next one and for those
 * who look - density, pressure, moduli - stays: looking changes nothing. Arrays that are SCRATCH serve
 * instead. */
static void sweep_part(solid_backend *b, int with_activation, int with_damping) {
    sphm_solid_field field = b->field;
    sphm_solid_lines lines = b->lines;
    field.density = b->state.ax;
    field.pressure = b->state.ay;
    lines.block_modulus_Pa = b->spare_modulus;
    lines.block_inverted = b->spare_inverted;
    if (!with_damping)
        field.viscosity_Pa_s = field.hourglass_time_s = 0;
    if (!with_activation) {
        memset(b->state.az, 0, b->state.count * sizeof *b->state.az);
        field.activation = b->state.az;
    }
    sphm_solid_stress_sweep(&field, &lines);
    sphm_solid_force_sweep(&field, &lines);
}

/* The stress is a sum, so the parts are differences of sweeps with and without. */
static void wrench(sphm_backend *backend, const sphm_end_drive *drive, int end, sphm_wrench *w) {
    solid_backend *b = inside(backend);
    const sphm_state *s = &b->state;
    sphm_real *const *force = b->lines.force;
    sphm_end_state frame;
    double pivot[3], elastic_N[3], elastic_Nm[3];
    sphm_end_frame_state(&b->model->ends[end], drive, s->time_s, &s->ends[end], &frame);
    for (int d = 0; d < 3; ++d)
        pivot[d] = frame.position_m[d] - b->model->frame_m[d];
    sweep_part(b, 0, 0);
    sphm_solid_sum_end(s, force, end, pivot, w->passive_N, w->passive_Nm);
    sweep_part(b, 1, 0);
    sphm_solid_sum_end(s, force, end, pivot, elastic_N, elastic_Nm);
    sweep_part(b, 1, 1);
    sphm_solid_sum_end(s, force, end, pivot, w->force_N, w->moment_Nm);
    for (int d = 0; d < 3; ++d) {
        w->active_N[d] = elastic_N[d] - w->passive_N[d];
        w->active_Nm[d] = elastic_Nm[d] - w->passive_Nm[d];
        w->damping_N[d] = w->force_N[d] - elastic_N[d];
        w->damping_Nm[d] = w->moment_Nm[d] - elastic_Nm[d];
    }
    sphm_end_put_tendon_between(&b->model->ends[end], drive, s->time_s, &s->ends[end], w);
}

const sphm_backend_ops sphm_cpu_solid_backend = {"cpu",   create,   destroy, step,         view,
                                                 restore, limits,   timing,  reset_timing, device,
                                                 wrench,  clock_of, 1,       NULL,         NULL};
