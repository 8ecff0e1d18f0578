/* Choosing and making a back end; see choose_backend.h. */
#include "core/choose_backend.h"

#include <stdio.h>
#include <string.h>

#include "core/context.h"

static sphm_status make(const sphm_backend_ops *ops, const sphm_model *model, sphm_chosen_backend *chosen,
                        sphm_context *context) {
    const sphm_status status = ops->create(model, &chosen->backend, context);
    if (status != SPHM_OK)
        return status;
    chosen->ops = ops;
    snprintf(chosen->device, sizeof chosen->device, "%s", ops->device(chosen->backend));
    return SPHM_OK;
}

static sphm_status make_cpu(const sphm_model *model, sphm_chosen_backend *chosen, sphm_context *context) {
    const int solid = model->parameters.tissue == SPHM_TISSUE_SOLID;
    return make(solid ? &sphm_cpu_solid_backend : &sphm_cpu_backend, model, chosen, context);
}

#ifdef SPHM_WITH_CUDA

static const sphm_backend_ops *cuda_ops(const sphm_parameters *parameters) {
    return parameters->tissue == SPHM_TISSUE_SOLID ? sphm_cuda_solid_backend() : sphm_cuda_fluid_backend();
}

static sphm_status refuse(sphm_status status, const char *why, sphm_context *context) {
    return sphm_fail(context, status, "backend is cuda, but %s; backend: cpu or auto would run", why);
}

sphm_status sphm_backend_available(const sphm_parameters *parameters, sphm_context *context) {
    sphm_context own;
    memset(&own, 0, sizeof own);
    if (parameters->backend != SPHM_BACKEND_CUDA)
        return SPHM_OK;
    const sphm_status status = sphm_cuda_probe(&own);
    return status == SPHM_OK ? SPHM_OK : refuse(status, own.message, context);
}

static sphm_status make_cuda(const sphm_model *model, sphm_chosen_backend *chosen, sphm_context *context) {
    const sphm_status status = sphm_cuda_probe(context);
    return status == SPHM_OK ? make(cuda_ops(&model->parameters), model, chosen, context) : status;
}

sphm_status sphm_backend_create(const sphm_model *model, sphm_chosen_backend *chosen, sphm_context *context) {
    memset(chosen, 0, sizeof *chosen);
    const int asked = model->parameters.backend;
    if (asked == SPHM_BACKEND_CPU)
        return make_cpu(model, chosen, context);
    sphm_context own;
    memset(&own, 0, sizeof own);
    if (context) { /* its notes and warnings go where they would go without this detour */
        own.log = context->log;
        own.user = context->user;
    }
    const sphm_status on_gpu = make_cuda(model, chosen, &own);
    if (on_gpu == SPHM_OK)
        return SPHM_OK;
    if (asked == SPHM_BACKEND_CUDA)
        return refuse(on_gpu, own.message, context);
    const sphm_status status = make_cpu(model, chosen, context);
    if (status != SPHM_OK)
        return status;
    sphm_log(context, SPHM_LOG_INFO, "%s: computing on the CPU", own.message);
    const size_t used = strlen(chosen->device);
    snprintf(chosen->device + used, sizeof chosen->device - used, " (%.120s)", own.message);
    return SPHM_OK;
}

#else

sphm_status sphm_backend_available(const sphm_parameters *parameters, sphm_context *context) {
    if (parameters->backend != SPHM_BACKEND_CUDA)
        return SPHM_OK;
    return sphm_fail(
        context, SPHM_REFUSED_UNSUPPORTED,
        "backend is cuda, but this library was built without CUDA; backend: cpu or auto would run");
}

sphm_status sphm_backend_create(const sphm_model *model, sphm_chosen_backend *chosen, sphm_context *context) {
    memset(chosen, 0, sizeof *chosen);
    const sphm_status status = sphm_backend_available(&model->parameters, context);
    return status == SPHM_OK ? make_cpu(model, chosen, context) : status;
}

#endif
