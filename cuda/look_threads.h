/* What one thread of each launch of a look does (doc/cuda.md). Compiled by nvcc, which runs one thread each,
 * and by the tests, which run them one after the other. */
#ifndef SPHM_CUDA_LOOK_THREADS_H
#define SPHM_CUDA_LOOK_THREADS_H

#include "cuda/look_layout.h"

/* Thread 0 ... SPHM_LOOK_PARTIALS - 1. */
SPHM_FN void sphm_look_shape_thread(const sphm_look_device *d, size_t thread) {
    sphm_shape_sums sums;
    double *numbers = (double *)&sums, *part = d->shape_part + thread * SPHM_SHAPE_NUMBERS;
    for (int k = 0; k < SPHM_SHAPE_NUMBERS; ++k)
        numbers[k] = 0;
    for (size_t i = thread; i < d->count; i += SPHM_LOOK_PARTIALS)
        sphm_look_add_shape(&d->constants, &d->role[i], d->rest + 3 * i, &d->line[i], &sums);
    for (int k = 0; k < SPHM_SHAPE_NUMBERS; ++k)
        part[k] = numbers[k];
}

/* Thread: the number, 0 ... SPHM_SHAPE_NUMBERS - 1. */
SPHM_FN void sphm_look_add_shape_thread(const sphm_look_device *d, size_t thread) {
    double sum = 0;
    for (size_t t = 0; t < SPHM_LOOK_PARTIALS; ++t)
        sum += d->shape_part[t * SPHM_SHAPE_NUMBERS + thread];
    ((double *)&d->result->shape_sums)[thread] = sum;
}

SPHM_FN void sphm_look_find_shape_thread(const sphm_look_device *d) {
    sphm_look_find_shape(&d->constants, &d->result->shape_sums, &d->result->shape);
}

/* Thread: the particle. */
SPHM_FN void sphm_look_pack_thread(const sphm_look_device *d, size_t i) {
    const sphm_look_particle *p = &d->line[i];
    const uint64_t begin = d->fibre_start[i];
    sphm_look_pack(&d->constants, &d->result->shape.motion, d->rest + 3 * i, p, i, d->count, d->fields);
    d->fields[16 * d->count + i] =
        sphm_look_stretch(d->line->place_m, sizeof *p / sizeof(sphm_real), i, d->fibre_particle + begin,
                          d->fibre_weight + begin, (size_t)(d->fibre_start[i + 1] - begin));
    for (size_t a = 0; a < 3; ++a)
        d->place[3 * i + a] = p->place_m[a];
}

/* As for shape; reads the stretch that pack has left. */
SPHM_FN void sphm_look_field_thread(const sphm_look_device *d, size_t thread) {
    sphm_field_sums sums;
    double *numbers = (double *)&sums, *part = d->field_part + thread * SPHM_FIELD_NUMBERS;
    for (int k = 0; k < SPHM_FIELD_NUMBERS; ++k)
        numbers[k] = 0;
    for (size_t i = thread; i < d->count; i += SPHM_LOOK_PARTIALS) {
        const double stretch = d->role[i].attached ? 0 : (double)d->fields[16 * d->count + i];
        sphm_look_add_fields(&d->constants, &d->result->shape, &d->role[i], d->rest + 3 * i, &d->line[i],
                             stretch, &sums);
    }
    for (int k = 0; k < SPHM_FIELD_NUMBERS; ++k)
        part[k] = numbers[k];
}

SPHM_FN void sphm_look_add_field_thread(const sphm_look_device *d, size_t thread) {
    double sum = 0;
    for (size_t t = 0; t < SPHM_LOOK_PARTIALS; ++t)
        sphm_look_add_number((int)thread, d->field_part[t * SPHM_FIELD_NUMBERS + thread], &sum);
    ((double *)&d->result->field_sums)[thread] = sum;
}

/* Thread 0 ... sphm_look_threads() - 1 of a launch. */
SPHM_FN void sphm_look_run_thread(const sphm_look_device *d, int launch, size_t thread) {
    switch (launch) {
    case SPHM_LOOK_SHAPE:
        sphm_look_shape_thread(d, thread);
        break;
    case SPHM_LOOK_ADD_SHAPE:
        sphm_look_add_shape_thread(d, thread);
        break;
    case SPHM_LOOK_FIND_SHAPE:
        sphm_look_find_shape_thread(d);
        break;
    case SPHM_LOOK_PACK:
        sphm_look_pack_thread(d, thread);
        break;
    case SPHM_LOOK_FIELD:
        sphm_look_field_thread(d, thread);
        break;
    default:
        sphm_look_add_field_thread(d, thread);
        break;
    }
}

SPHM_FN size_t sphm_look_threads(const sphm_look_device *d, int launch) {
    switch (launch) {
    case SPHM_LOOK_ADD_SHAPE:
        return SPHM_SHAPE_NUMBERS;
    case SPHM_LOOK_FIND_SHAPE:
        return 1;
    case SPHM_LOOK_PACK:
        return d->count;
    case SPHM_LOOK_ADD_FIELD:
        return SPHM_FIELD_NUMBERS;
    default:
        return SPHM_LOOK_PARTIALS;
    }
}

#endif
