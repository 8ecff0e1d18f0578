/* Reading a neighbour row into vectors, and the arithmetic of the sweeps on them.
 *
 * Sweeps keep what they need of a particle in packs of four values, one load each, and turn 16 packs into 4
 * vectors. That costs a quarter of gathering from 4 arrays (AVX-512 gathers 16 values in some 26 cycles).
 * The vectors stay in registers: 16 entries of a row are read, used and forgotten. Loops over plain arrays
 * that the compiler vectorises were tried before; they cost a store and a load of every vector, and a
 * division and a root, for which no compiler takes the approximate instructions without giving up IEEE
 * arithmetic everywhere.
 *
 * The vectors are those of gcc and clang, which know the operators and lower them to whatever the processor
 * has. */
#ifndef SPHM_CPU_ROW_H
#define SPHM_CPU_ROW_H

#ifdef __AVX512F__
#include <immintrin.h>
#endif

#include "core/neighbours.h"
#include "kernels/smoothing.h"

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wpsabi" /* everything here is inlined: no such vector is ever passed */
#endif

#define SPHM_LANES SPHM_ROW_ALIGN
#define SPHM_INLINE static inline __attribute__((always_inline))

typedef struct sphm_pack {
    sphm_real x, y, z, w;
} sphm_pack;

/* One value for each of 16 entries of a row. */
typedef sphm_real sphm_lanes __attribute__((vector_size(SPHM_LANES * sizeof(sphm_real))));
#ifdef SPH_MUSCLE_DOUBLE
typedef int64_t sphm_lane_mask __attribute__((vector_size(SPHM_LANES * sizeof(int64_t))));
#else
typedef int32_t sphm_lane_mask __attribute__((vector_size(SPHM_LANES * sizeof(int32_t))));
#endif

/* 16 packs, taken apart. */
typedef struct sphm_row_packs {
    sphm_lanes x, y, z, w;
} sphm_row_packs;

#if defined(__AVX512F__) && !defined(SPH_MUSCLE_DOUBLE)

/* Packs slot[0], slot[4], slot[8], slot[12] in the four quarters of a vector. */
SPHM_INLINE __m512 sphm_load_quarters(const sphm_pack *packs, const int32_t *slot) {
    __m512 v = _mm512_castps128_ps512(_mm_load_ps(&packs[slot[0]].x));
    v = _mm512_insertf32x4(v, _mm_load_ps(&packs[slot[4]].x), 1);
    v = _mm512_insertf32x4(v, _mm_load_ps(&packs[slot[8]].x), 2);
    return _mm512_insertf32x4(v, _mm_load_ps(&packs[slot[12]].x), 3);
}

SPHM_INLINE sphm_row_packs sphm_row_read(const sphm_pack *packs, const int32_t *slot) {
    const __m512 a = sphm_load_quarters(packs, slot), b = sphm_load_quarters(packs, slot + 1);
    const __m512 c = sphm_load_quarters(packs, slot + 2), d = sphm_load_quarters(packs, slot + 3);
    const __m512 ab_low = _mm512_unpacklo_ps(a, b), ab_high = _mm512_unpackhi_ps(a, b);
    const __m512 cd_low = _mm512_unpacklo_ps(c, d), cd_high = _mm512_unpackhi_ps(c, d);
    sphm_row_packs r;
    r.x = (sphm_lanes)_mm512_shuffle_ps(ab_low, cd_low, 0x44);
    r.y = (sphm_lanes)_mm512_shuffle_ps(ab_low, cd_low, 0xee);
    r.z = (sphm_lanes)_mm512_shuffle_ps(ab_high, cd_high, 0x44);
    r.w = (sphm_lanes)_mm512_shuffle_ps(ab_high, cd_high, 0xee);
    return r;
}

/* max(a, 0) */
SPHM_INLINE sphm_lanes sphm_lanes_positive(sphm_lanes a) {
    return (sphm_lanes)_mm512_max_ps((__m512)a, _mm512_setzero_ps());
}

/* Within 2 units in the last place: 14 bits from the processor and one step of Newton's method. Intel
 * defines the 14 bits to the last one, in public reference code. */
SPHM_INLINE sphm_lanes sphm_lanes_inverse_sqrt(sphm_lanes a) {
    const sphm_lanes y = (sphm_lanes)_mm512_rsqrt14_ps((__m512)a);
    return y * (1.5f - 0.5f * a * y * y);
}

SPHM_INLINE sphm_lanes sphm_lanes_inverse(sphm_lanes a) {
    const sphm_lanes y = (sphm_lanes)_mm512_rcp14_ps((__m512)a);
    return y * (2.0f - a * y);
}

#else

SPHM_INLINE sphm_row_packs sphm_row_read(const sphm_pack *packs, const int32_t *slot) {
    sphm_row_packs r;
    for (int k = 0; k < SPHM_LANES; ++k) {
        const sphm_pack pack = packs[slot[k]];
        r.x[k] = pack.x;
        r.y[k] = pack.y;
        r.z[k] = pack.z;
        r.w[k] = pack.w;
    }
    return r;
}

SPHM_INLINE sphm_lanes sphm_lanes_positive(sphm_lanes a) {
    return (sphm_lanes)((sphm_lane_mask)a & (a > 0));
}

SPHM_INLINE sphm_lanes sphm_lanes_inverse_sqrt(sphm_lanes a) {
    for (int k = 0; k < SPHM_LANES; ++k)
        a[k] = sphm_inverse_sqrt(a[k]);
    return a;
}

SPHM_INLINE sphm_lanes sphm_lanes_inverse(sphm_lanes a) {
    return 1 / a;
}

#endif

/* The first n lanes of a, 0 in the others. */
SPHM_INLINE sphm_lanes sphm_lanes_first(sphm_lanes a, int32_t n) {
    const sphm_lane_mask index = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    return (sphm_lanes)((sphm_lane_mask)a & (index < n));
}

/* Pairwise: the same order whatever the processor. */
SPHM_INLINE sphm_real sphm_lanes_sum(sphm_lanes a) {
    sphm_real s[8];
    for (int k = 0; k < 8; ++k)
        s[k] = a[k] + a[k + 8];
    return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
}

#endif
