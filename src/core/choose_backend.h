/* Which back end computes a muscle: what was asked for, what was built, and what answers. */
#ifndef SPHM_CORE_CHOOSE_BACKEND_H
#define SPHM_CORE_CHOOSE_BACKEND_H

#include "core/backend.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_chosen_backend {
    const sphm_backend_ops *ops;
    sphm_backend *backend;
    char device[192]; /* what it computes on and, where `auto` wanted another, why it could not have it */
} sphm_chosen_backend;

/* Refuses what sphm_backend_create() would refuse whatever the model: a back end that was not built or does
 * not answer. */
sphm_status sphm_backend_available(const sphm_parameters *parameters, sphm_context *context);
/* Makes the back end that `backend` of the model's parameters asks for. `auto` takes the CPU, with a note to
 * the log, where the GPU does not answer or refuses. On anything but SPHM_OK nothing is kept. */
sphm_status sphm_backend_create(const sphm_model *model, sphm_chosen_backend *chosen, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
