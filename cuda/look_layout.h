/* A look at a muscle in device memory: rest data, the state as it was, sums and packed particles. Plain
 * structs that both compilers lay out alike; pointers are the device's. */
#ifndef SPHM_CUDA_LOOK_LAYOUT_H
#define SPHM_CUDA_LOOK_LAYOUT_H

#include "kernels/look.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Threads that share the particles of a sum: thread t adds up t, t + PARTIALS, ..., whatever the device, so
 * the bits are always the same. More would leave longer tails to add up, fewer keep a large device idle. */
#define SPHM_LOOK_PARTIALS 2048

typedef struct sphm_look_result {
    sphm_shape_sums shape_sums;
    sphm_look_shape shape;
    sphm_field_sums field_sums;
} sphm_look_result;

/* All a thread needs; passed to every launch by value. */
typedef struct sphm_look_device {
    size_t count; /* particles */
    sphm_look_constants constants;
#define ARRAY(type, name, elements, meaning) type *name;
#include "cuda/look_arrays.inc"
#undef ARRAY
} sphm_look_device;

/* In this order. */
enum {
    SPHM_LOOK_SHAPE,
    SPHM_LOOK_ADD_SHAPE,
    SPHM_LOOK_FIND_SHAPE,
    SPHM_LOOK_PACK,
    SPHM_LOOK_FIELD,
    SPHM_LOOK_ADD_FIELD,
    SPHM_LOOK_LAUNCHES
};

#ifdef __cplusplus
}
#endif
#endif
