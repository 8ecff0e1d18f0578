// Muscles on the emulated device.
#ifndef SPHM_TEST_EMULATED_MUSCLE_H
#define SPHM_TEST_EMULATED_MUSCLE_H

#include "emulated_device.h"
#include "muscles.h"

// A muscle whose back end computes on the emulated device.
struct Emulated : Muscle {
    explicit Emulated(const Settings &settings) : Muscle(settings) {
        const bool fluid = handle && sphm_muscle_parameters(handle)->tissue == SPHM_TISSUE_FLUID;
        if (status == SPHM_OK)
            take(fluid ? emulated::fluid_ops() : emulated::backend_ops());
    }
    void take(const sphm_backend_ops *ops) {
        handle->ops->destroy(handle->backend);
        handle->backend = nullptr;
        handle->ops = ops;
        ASSERT_EQ(handle->ops->create(&handle->model, &handle->backend, &context), SPHM_OK)
            << context.message;
    }
};

inline Muscle::Settings solid(Muscle::Settings more = {}) {
    Muscle::Settings settings = {{"tissue", "solid"}, {"particles", "500"}, {"time_step", "2e-5"}};
    settings.insert(settings.end(), more.begin(), more.end());
    return settings;
}

#endif
