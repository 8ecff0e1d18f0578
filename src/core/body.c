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
#include "core/winding.h"

#include <stdlib.h>
#include <string.h>

/* A filling whose volume differs by more from that of the mesh hints at a mesh with large holes. */
#define VOLUME_DOUBT 0.03

void sphm_body_free(sphm_body *body) {
    if (!body)
        return;
    free(body->positions);
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

/* Where the solid tissue's ends are held, along the lattice's first direction: layers then lie as the clamps
 * want it (attachments: line_of_action.c). A mesh with holes is filled once more to find these
 * sections. */
static sphm_status find_sections(const sphm_body *body, const sphm_parameters *parameters,
                                 sphm_filling_task *task, sphm_context *context) {
    if (parameters->tissue != SPHM_TISSUE_SOLID || parameters->attachment_fraction == 0)
        return SPHM_OK;
    sphm_filling first;
    memset(&first, 0, sizeof first);
    sphm_cut_body whole = {&body->surface, NULL, 0, 0};
    sphm_status status = SPHM_OK;
    if (body->report.open_edges > 0) {
        status = sphm_filling_create(task, &first, context);
        whole = (sphm_cut_body){NULL, first.positions, first.count, first.spacing_m};
    }
    if (status == SPHM_OK)
        sphm_end_sections(&whole, task->frame[0], parameters->attachment_fraction, task->sections_m);
    sphm_filling_free(&first);
    return status;
}

/* Lattices lie along the axes of the preset frame, or along the principal directions of a mesh, where their
 * box is smallest and their layers cross the muscle. */
static sphm_status fill_surface(sphm_body *body, const sphm_parameters *parameters, const sphm_surface *mesh,
                                const sphm_winding *winding, sphm_filling *filling, sphm_context *context) {
    sphm_filling_task task;
    memset(&task, 0, sizeof task);
    task.surface = &body->surface;
    task.winding = winding;
    task.volume_m3 = body->volume_m3;
    task.particles = parameters->particles;
    task.threads = parameters->threads;
    for (int k = 0; k < 3; k++)
        task.frame[k][k] = 1;
    if (mesh)
        sphm_surface_principal_frame(&body->surface, task.frame);
    sphm_status status = find_sections(body, parameters, &task, context);
    return status == SPHM_OK ? sphm_filling_create(&task, filling, context) : status;
}

static sphm_status fill(sphm_body *body, const sphm_parameters *parameters, const sphm_surface *mesh,
                        sphm_filling *filling, sphm_context *context) {
    sphm_winding *winding;
    sphm_status status = sphm_winding_create(&body->surface, &winding, context);
    if (status != SPHM_OK)
        return status;
    if (is_bar(parameters, mesh)) {
        double side[3] = {parameters->belly_length, parameters->belly_width, parameters->belly_thickness};
        status = sphm_filling_create_bar(side, parameters->particles, filling, context);
    } else {
        status = fill_surface(body, parameters, mesh, winding, filling, context);
    }
    if (status == SPHM_OK && parameters->jitter > 0)
        sphm_filling_jitter(filling, winding, parameters->jitter, (uint64_t)parameters->seed,
                            parameters->threads);
    sphm_winding_destroy(winding);
    return status;
}

/* Takes the particles over from the filling. */
static sphm_status take_particles(sphm_body *body, const sphm_parameters *parameters,
                                  const sphm_surface *mesh, sphm_context *context) {
    sphm_filling filling;
    memset(&filling, 0, sizeof filling);
    sphm_status status = fill(body, parameters, mesh, &filling, context);
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
    body->fibres = malloc(3 * body->count * sizeof *body->fibres);
    body->axial_fraction = malloc(body->count * sizeof *body->axial_fraction);
    body->attachment = malloc(body->count);
    body->region = malloc(body->count);
    if (!body->fibres || !body->axial_fraction || !body->attachment || !body->region)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for %zu particles", body->count);
    return SPHM_OK;
}

static sphm_status find_line(sphm_body *body, const sphm_parameters *parameters, const sphm_surface *mesh,
                             sphm_context *context) {
    const double ends[2][3] = {{body->lower_m[0], 0, 0}, {body->upper_m[0], 0, 0}};
    return sphm_body_find_line_of_action(body, parameters, mesh ? NULL : ends, context);
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

static sphm_status build(sphm_body *body, const sphm_parameters *parameters, const sphm_surface *mesh,
                         sphm_context *context) {
    sphm_status status = take_surface(body, parameters, mesh, context);
    if (status == SPHM_OK)
        status = take_particles(body, parameters, mesh, context);
    if (status == SPHM_OK)
        status = find_line(body, parameters, mesh, context);
    if (status == SPHM_OK)
        status = sphm_body_divide(body, parameters, context);
    if (status != SPHM_OK)
        return status;
    sphm_body_measure_section(body);
    set_support(body, parameters);
    status = count_isolated(body, parameters->threads, context);
    return status == SPHM_OK ? sphm_body_lay_fibres(body, parameters, context) : status;
}

sphm_status sphm_body_create(const sphm_parameters *parameters, const sphm_surface *mesh, sphm_body *body,
                             sphm_context *context) {
    memset(body, 0, sizeof *body);
    sphm_status status = build(body, parameters, mesh, context);
    if (status != SPHM_OK)
        sphm_body_free(body);
    return status;
}
