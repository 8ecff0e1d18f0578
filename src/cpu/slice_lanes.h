/* 16 particles side by side as a vector: loads and stores at any address, and of some of the lanes. */
#ifndef SPHM_CPU_SLICE_LANES_H
#define SPHM_CPU_SLICE_LANES_H

#include "cpu/row.h"

/* gcc takes a memcpy() of one over the stack now and then. */
typedef sphm_real sphm_loose_lanes
    __attribute__((vector_size(SPHM_LANES * sizeof(sphm_real)), aligned(4), may_alias));

SPHM_INLINE sphm_lanes sphm_lanes_load(const sphm_real *from) {
    return *(const sphm_loose_lanes *)from;
}

SPHM_INLINE sphm_lanes sphm_lanes_load_aligned(const sphm_real *from) {
    return *(const sphm_lanes *)__builtin_assume_aligned(from, sizeof(sphm_lanes));
}

SPHM_INLINE sphm_lanes sphm_lanes_repeat(sphm_real value) {
    return value - (sphm_lanes){0};
}

#if defined(__AVX512F__) && !defined(SPH_MUSCLE_DOUBLE)

typedef __mmask16 sphm_some;

SPHM_INLINE sphm_some sphm_some_of(uint16_t lanes) {
    return lanes;
}
SPHM_INLINE sphm_lanes sphm_lanes_load_some(const sphm_real *from, sphm_some lanes) {
    return (sphm_lanes)_mm512_maskz_loadu_ps(lanes, from);
}
SPHM_INLINE void sphm_lanes_store_some(sphm_real *to, sphm_lanes value, sphm_some lanes) {
    _mm512_mask_storeu_ps(to, lanes, (__m512)value);
}
/* a - b, or 0 */
SPHM_INLINE sphm_lanes sphm_lanes_subtract_some(sphm_lanes a, sphm_lanes b, sphm_some lanes) {
    return (sphm_lanes)_mm512_maskz_sub_ps(lanes, (__m512)a, (__m512)b);
}
/* sum + a b, or sum */
SPHM_INLINE sphm_lanes sphm_lanes_add_some(sphm_lanes sum, sphm_lanes a, sphm_lanes b, sphm_some lanes) {
    return (sphm_lanes)_mm512_mask3_fmadd_ps((__m512)a, (__m512)b, (__m512)sum, lanes);
}

#else

typedef sphm_lane_mask sphm_some;

SPHM_INLINE sphm_some sphm_some_of(uint16_t lanes) {
    const sphm_lane_mask bit = {1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768};
    return (bit & lanes) != 0;
}
SPHM_INLINE sphm_lanes sphm_lanes_choose(sphm_lanes a, sphm_some lanes) {
    return (sphm_lanes)((sphm_lane_mask)a & lanes);
}
SPHM_INLINE sphm_lanes sphm_lanes_load_some(const sphm_real *from, sphm_some lanes) {
    sphm_lanes v = {0};
    for (int k = 0; k < SPHM_LANES; ++k)
        if (lanes[k])
            v[k] = from[k];
    return v;
}
SPHM_INLINE void sphm_lanes_store_some(sphm_real *to, sphm_lanes value, sphm_some lanes) {
    for (int k = 0; k < SPHM_LANES; ++k)
        if (lanes[k])
            to[k] = value[k];
}
SPHM_INLINE sphm_lanes sphm_lanes_subtract_some(sphm_lanes a, sphm_lanes b, sphm_some lanes) {
    return sphm_lanes_choose(a - b, lanes);
}
SPHM_INLINE sphm_lanes sphm_lanes_add_some(sphm_lanes sum, sphm_lanes a, sphm_lanes b, sphm_some lanes) {
    return sum + sphm_lanes_choose(a, lanes) * b;
}

#endif

SPHM_INLINE uint16_t sphm_first_lanes(int32_t count) {
    return (uint16_t)((1u << count) - 1);
}

#endif
