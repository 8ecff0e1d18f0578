/* The constant part of a muscle, from parameters and a surface. */
#include "core/model.h"

#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "core/electrodes.h"
#include "core/end_blocks.h"
#include "core/membrane_constants.h"
#include "core/solid_constants.h"

void sphm_model_free(sphm_model *model) {
    sphm_body_free(&model->body);
    free(model->electrodes);
    memset(model, 0, sizeof *model);
}

static void set_frame(sphm_model *model) {
    const sphm_body *body = &model->body;
    double lower[3], upper[3];
    for (int d = 0; d < 3; ++d) {
        lower[d] = upper[d] = body->positions[d];
        for (size_t i = 1; i < body->count; ++i) {
            const double value = body->positions[3 * i + (size_t)d];
            lower[d] = value < lower[d] ? value : lower[d];
            upper[d] = value > upper[d] ? value : upper[d];
        }
        model->frame_m[d] = 0.5 * (lower[d] + upper[d]);
    }
}

static sphm_fluid_constants fluid_constants(const sphm_model *model) {
    const sphm_parameters *p = &model->parameters;
    sphm_fluid_constants c;
    memset(&c, 0, sizeof c);
    c.coupling = p->coupling;
    c.support_radius_m = (sphm_real)model->body.support_radius_m;
    c.mass_kg = (sphm_real)model->particle_mass_kg;
    c.density_kg_per_m3 = (sphm_real)p->density;
    c.stiffness_m2_per_s2 = (sphm_real)p->stiffness;
    c.resting_mV = (sphm_real)p->resting_potential;
    if (p->coupling == SPHM_COUPLING_PRESSURE)
        c.electrical_Pa_per_mV = (sphm_real)p->electrical_pressure;
    else
        c.fibre_tension_Pa = (sphm_real)p->fibre_tension;
    c.tension_slope = (sphm_real)p->tension_slope;
    c.viscosity_Pa_s = (sphm_real)p->viscosity;
    c.xsph_time_s = (sphm_real)p->xsph_time;
    c.fibre_steering = (sphm_real)p->fibre_steering;
    c.shape_matching_rad_per_s = (sphm_real)p->shape_matching_rate;
    c.shape_matching_floor = (sphm_real)p->shape_matching_floor;
    c.pair_matching_Pa = (sphm_real)p->pair_matching;
    for (int d = 0; d < 3; ++d)
        c.gravity_m_per_s2[d] = (sphm_real)p->gravity[d];
    return c;
}

static sphm_status mark_electrodes(sphm_model *model, sphm_context *context) {
    model->electrodes = (uint8_t *)calloc(model->body.count, 1);
    if (!model->electrodes)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the electrodes of %zu particles",
                         model->body.count);
    return sphm_electrodes_mark(&model->parameters, &model->body, model->electrodes, context);
}

static sphm_status fill_model(sphm_model *model, const sphm_surface *mesh, sphm_context *context) {
    const sphm_parameters *parameters = &model->parameters;
    sphm_status status = sphm_body_create(parameters, mesh, &model->body, context);
    if (status == SPHM_OK)
        status = mark_electrodes(model, context);
    if (status != SPHM_OK)
        return status;
    set_frame(model);
    model->particle_volume_m3 = model->body.volume_m3 / (double)model->body.count;
    model->particle_mass_kg = parameters->density * model->particle_volume_m3;
    model->membrane = sphm_membrane_constants_from(parameters, model->body.spacing_m);
    model->fluid = fluid_constants(model);
    model->solid = sphm_solid_constants_from(parameters);
    for (int end = 0; end < 2; ++end)
        model->ends[end] = sphm_end_block_from(parameters, &model->body, end);
    return SPHM_OK;
}

sphm_status sphm_model_create(sphm_model *model, const sphm_parameters *parameters, const sphm_surface *mesh,
                              sphm_context *context) {
    memset(model, 0, sizeof *model);
    const sphm_status checked = sphm_parameters_check(parameters, context);
    if (checked != SPHM_OK)
        return checked;
    model->parameters = *parameters;
    const sphm_status status = fill_model(model, mesh, context);
    if (status != SPHM_OK)
        sphm_model_free(model);
    return status;
}

void sphm_model_rest_state(const sphm_model *model, sphm_state *s) {
    const sphm_body *body = &model->body;
    for (int end = 0; end < 2; ++end)
        sphm_end_body_rest(&s->ends[end]);
    for (size_t i = 0; i < s->count; ++i) {
        s->rest_x[i] = s->x[i] = s->listed_x[i] = (sphm_real)(body->positions[3 * i] - model->frame_m[0]);
        s->rest_y[i] = s->y[i] = s->listed_y[i] = (sphm_real)(body->positions[3 * i + 1] - model->frame_m[1]);
        s->rest_z[i] = s->z[i] = s->listed_z[i] = (sphm_real)(body->positions[3 * i + 2] - model->frame_m[2]);
        s->fibre_x[i] = (sphm_real)body->fibres[3 * i];
        s->fibre_y[i] = (sphm_real)body->fibres[3 * i + 1];
        s->fibre_z[i] = (sphm_real)body->fibres[3 * i + 2];
        s->relative_volume[i] = (sphm_real)(body->volumes[i] / model->particle_volume_m3);
        s->attachment[i] = body->attachment[i];
        s->electrodes[i] = model->electrodes[i];
        s->membrane_potential[i] = model->membrane.resting_mV;
        s->density[i] = (sphm_real)model->parameters.density;
    }
}
