/* The muscle's rest shape, from a surface to particles with fibres, attachments and regions. Reads the
 * parameters and a mesh, writes sphm_body. */
#include "core/belly.h"
#include "core/context.h"
#include "core/fibres.h"
#include "core/filling.h"
#include "core/line_of_action.h"
#include "core/point_grid.h"
#include "core/section.h"
#include "core/threads.h"
#include "core/vec3.h"
#include "core/volumes.h"
#include "core/winding.h"

#include <stdlib.h>
#include <string.h>

/* A filling whose volume differs by more from that of the mesh hints at a mesh with large holes. */
#define VOLUME_DOUBT 0.03

void sphm_body_free(sphm_body *body) {
    if (!body)
        return;
    free(body->positions);
    free(body->volumes);
    free(body->fibres);
    free(body->axial_fraction);
    free(body->attachment);
    free(body->region);
    free(body->outer);
    sphm_surface_free(&body->surface);
    memset(body, 0, sizeof *body);
}

static int is_bar(const sphm_parameters *parameters, const sphm_surface *mesh) {
    return !mesh && parameters->preset == SPHM_PRESET_BAR;
}

static sphm_status take_surface(sphm_body *body, const sphm_parameters *parameters, const sphm_surface *mesh,
                                sphm_context *context) {
    sphm_status status = mesh ? sphm_surface_copy(mesh, &body->surface, context)
                              : sphm_surface_preset(parameters, &body->surface, context);
    if (status == SPHM_OK)
        status = sphm_surface_repair(&body->surface, &body->report, context);
    if (status != SPHM_OK)
        return status;
    const sphm_surface_report *r = &body->report;
    memcpy(body->lower_m, r->lower_m, sizeof body->lower_m);
    memcpy(body->upper_m, r->upper_m, sizeof body->upper_m);
    body->volume_m3 = r->volume_m3;
    if (mesh)
        sphm_log(
            context, SPHM_LOG_INFO,
            "mesh: %zu triangles, %.4g m3, %zu open edges, %zu components of which %zu small ones left out, "
            "%zu degenerate triangles left out",
            body->surface.triangle_count, r->volume_m3, r->open_edges, r->components, r->dropped_fragments,
            r->degenerate);
    return SPHM_OK;
}

/* What is known of a shape while its body is made. */
typedef struct made_from {
    const sphm_parameters *parameters;
    const sphm_surface *mesh; /* NULL: the preset */
    sphm_winding *winding;
    sphm_filling fine; /* where a mesh's line of action or sections are found; else empty */
} made_from;

/* The sections of the solid tissue's clamps are cut from this; a surface with holes has no volume of its own
 * (section.h). */
static sphm_cut_body what_is_cut(const sphm_body *body, const made_from *from) {
    if (body->report.open_edges > 0)
        return (sphm_cut_body){NULL, from->fine.positions, from->fine.count, from->fine.spacing_m};
    return (sphm_cut_body){&body->surface, NULL, 0, 0};
}

static int is_clamped_in_sections(const sphm_parameters *parameters) {
    return parameters->tissue == SPHM_TISSUE_SOLID && parameters->attachment_fraction > 0;
}

/* Lattices lie along the axes of the preset frame, or along the principal directions of a mesh, where their
 * box is smallest and their layers cross the muscle. */
static sphm_filling_task filling_task(const sphm_body *body, const made_from *from) {
    sphm_filling_task task;
    memset(&task, 0, sizeof task);
    task.surface = &body->surface;
    task.winding = from->winding;
    task.volume_m3 = body->volume_m3;
    task.particles = from->parameters->particles;
    task.threads = from->parameters->threads;
    for (int k = 0; k < 3; k++)
        task.frame[k][k] = 1;
    if (from->mesh)
        sphm_surface_principal_frame(&body->surface, task.frame);
    return task;
}

static sphm_status fill_finely(const sphm_body *body, made_from *from, sphm_context *context) {
    int seeks_line = from->mesh && !sphm_line_of_action_is_given(from->parameters),
        seeks_sections = body->report.open_edges > 0 && is_clamped_in_sections(from->parameters);
    if (!seeks_line && !seeks_sections)
        return SPHM_OK;
    sphm_filling_task task = filling_task(body, from);
    return sphm_filling_create_fine(&task, &from->fine, context);
}

/* The solid tissue is clamped in sections; along the lattice's first direction layers lie as the clamps want
 * it (attachments: line_of_action.c). */
static sphm_status fill_surface(const sphm_body *body, const made_from *from, sphm_filling *filling,
                                sphm_context *context) {
    sphm_filling_task task = filling_task(body, from);
    sphm_cut_body whole = what_is_cut(body, from);
    if (is_clamped_in_sections(from->parameters))
        sphm_end_sections(&whole, task.frame[0], from->parameters->attachment_fraction, task.sections_m);
    return sphm_filling_create(&task, filling, context);
}

static sphm_status fill(const sphm_body *body, const made_from *from, sphm_filling *filling,
                        sphm_context *context) {
    const sphm_parameters *p = from->parameters;
    double side[3] = {p->belly_length, p->belly_width, p->belly_thickness};
    sphm_status status = is_bar(p, from->mesh) ? sphm_filling_create_bar(side, p->particles, filling, context)
                                               : fill_surface(body, from, filling, context);
    if (status == SPHM_OK && p->jitter > 0)
        sphm_filling_jitter(filling, from->winding, p->jitter, (uint64_t)p->seed, p->threads);
    return status;
}

/* Takes the particles over from the filling. */
static sphm_status take_particles(sphm_body *body, const made_from *from, sphm_context *context) {
    sphm_filling filling;
    memset(&filling, 0, sizeof filling);
    sphm_status status = fill(body, from, &filling, context);
    if (status != SPHM_OK)
        return status;
    body->count = filling.count;
    body->spacing_m = filling.spacing_m;
    memcpy(body->step_m, filling.step_m, sizeof body->step_m);
    body->positions = filling.positions;
    body->outer = filling.outer;
    if (filling.strays > 0)
        sphm_log(context, SPHM_LOG_WARNING, "filling: %zu particles apart from the others were left out",
                 filling.strays);
    double filled = (double)filling.count * pow(filling.spacing_m, 3);
    if (fabs(filled - body->volume_m3) > VOLUME_DOUBT * body->volume_m3 && filling.count > 1000)
        sphm_log(
            context, SPHM_LOG_WARNING,
            "filling: the particles take %.4g m3, but the mesh's triangles say %.4g m3; has it large holes?",
            filled, body->volume_m3);
    body->volumes = malloc(body->count * sizeof *body->volumes);
    body->fibres = malloc(3 * body->count * sizeof *body->fibres);
    body->axial_fraction = malloc(body->count * sizeof *body->axial_fraction);
    body->attachment = malloc(body->count);
    body->region = malloc(body->count);
    if (!body->volumes || !body->fibres || !body->axial_fraction || !body->attachment || !body->region)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for %zu particles", body->count);
    return SPHM_OK;
}

/* A bar's cells are its particles' volumes, and the fluid's particles all have the same mass. */
static sphm_status find_volumes(sphm_body *body, const made_from *from, sphm_context *context) {
    const sphm_parameters *p = from->parameters;
    int displaced = p->jitter > 0, is_stairs = displaced || !is_bar(p, from->mesh);
    if (p->tissue == SPHM_TISSUE_SOLID && is_stairs)
        return sphm_body_measure_volumes(body, from->winding, displaced, p->threads, context);
    for (size_t i = 0; i < body->count; i++)
        body->volumes[i] = body->volume_m3 / (double)body->count;
    return SPHM_OK;
}

static sphm_status find_line(sphm_body *body, const made_from *from, sphm_context *context) {
    double ends[2][3] = {{body->lower_m[0], 0, 0}, {body->upper_m[0], 0, 0}};
    if (from->mesh && !sphm_line_of_action_is_given(from->parameters))
        sphm_principal_ends(&from->fine, ends);
    return sphm_body_find_line_of_action(body, from->parameters, (const double(*)[3])ends, context);
}

/* The fluid sums over what is within h as a continuum would. The solid corrects its sums, and the nearer its
 * neighbours the nearer to a surface its gradients belong: 32 neighbours (doc/solid.md). */
static double smoothing_ratio(const sphm_parameters *parameters) {
    if (parameters->smoothing_ratio > 0)
        return parameters->smoothing_ratio;
    return parameters->tissue == SPHM_TISSUE_SOLID ? 2.2 : 2.6;
}

/* h in the paper's units: the longest side of the bounding box is 2. */
static void set_support(sphm_body *body, const sphm_parameters *parameters) {
    double longest = 0;
    for (int k = 0; k < 3; k++)
        longest = fmax(longest, body->upper_m[k] - body->lower_m[k]);
    body->support_radius_m = parameters->paper_units ? parameters->paper_h * 0.5 * longest
                                                     : smoothing_ratio(parameters) * body->spacing_m;
}

/* Particles without a neighbour within h feel nothing of the others: a support that small is a mistake, but
 * the paper's shortest one comes near it, so that it is reported and not refused. */
static sphm_status count_isolated(sphm_body *body, int64_t threads, sphm_context *context) {
    sphm_point_grid grid;
    size_t isolated = 0;
    sphm_status status =
        sphm_point_grid_create(body->positions, body->count, body->support_radius_m, &grid, context);
    if (status != SPHM_OK)
        return status;
#pragma omp parallel for schedule(static) num_threads(sphm_team_size(threads))                               \
    reduction(+ : isolated) if (body->count > SPHM_SERIAL_BELOW)
    for (size_t p = 0; p < body->count; p++)
        isolated +=
            sphm_point_grid_within(&grid, &body->positions[3 * p], body->support_radius_m, NULL, 0) < 2;
    sphm_point_grid_free(&grid);
    body->isolated = isolated;
    if (body->isolated > 0)
        sphm_log(
            context, SPHM_LOG_WARNING,
            "%zu of %zu particles have no neighbour within the support radius of %.4g m (spacing %.4g m)",
            body->isolated, body->count, body->support_radius_m, body->spacing_m);
    return SPHM_OK;
}

static sphm_status divide(sphm_body *body, const made_from *from, sphm_context *context) {
    sphm_cut_body whole = what_is_cut(body, from);
    return sphm_body_divide(body, from->parameters, &whole, context);
}

static sphm_status build_from(sphm_body *body, made_from *from, sphm_context *context) {
    sphm_status status = take_surface(body, from->parameters, from->mesh, context);
    if (status == SPHM_OK)
        status = sphm_winding_create(&body->surface, &from->winding, context);
    if (status == SPHM_OK)
        status = fill_finely(body, from, context);
    if (status == SPHM_OK)
        status = take_particles(body, from, context);
    if (status == SPHM_OK)
        status = find_volumes(body, from, context);
    if (status == SPHM_OK)
        status = find_line(body, from, context);
    if (status == SPHM_OK)
        status = divide(body, from, context);
    if (status != SPHM_OK)
        return status;
    sphm_body_measure_section(body);
    set_support(body, from->parameters);
    status = count_isolated(body, from->parameters->threads, context);
    return status == SPHM_OK ? sphm_body_lay_fibres(body, from->parameters, context) : status;
}

static sphm_status build(sphm_body *body, const sphm_parameters *parameters, const sphm_surface *mesh,
                         sphm_context *context) {
    made_from from;
    memset(&from, 0, sizeof from);
    from.parameters = parameters;
    from.mesh = mesh;
    sphm_status status = build_from(body, &from, context);
    sphm_winding_destroy(from.winding);
    sphm_filling_free(&from.fine);
    return status;
}

sphm_status sphm_body_create(const sphm_parameters *parameters, const sphm_surface *mesh, sphm_body *body,
                             sphm_context *context) {
    memset(body, 0, sizeof *body);
    sphm_status status = build(body, parameters, mesh, context);
    if (status != SPHM_OK)
        sphm_body_free(body);
    return status;
}
