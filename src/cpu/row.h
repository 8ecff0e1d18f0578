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
#include "kernels/pairs.h"

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wpsabi" /* everything here is inlined: no such vector is ever passed */
#endif

#define SPHM_LANES SPHM_ROW_ALIGN
#define SPHM_INLINE static inline __attribute__((always_inline))

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

typedef struct sphm_row_twins {
    sphm_row_packs first, second;
} sphm_row_twins;

#if defined(__AVX512F__) && !defined(SPH_MUSCLE_DOUBLE)

/* The loops that fill small arrays of vectors are unrolled by order: gcc, at -O2, keeps them as loops, and
 * then every vector that is read goes through memory, a fifth of the sweeps' instructions. */

/* x of four packs in every quarter, from four vectors of four packs; then y, z, w. */
SPHM_INLINE void sphm_transpose_quarters(const __m512 v[4], __m512 out[4]) {
    const __m512 ab_low = _mm512_unpacklo_ps(v[0], v[1]), ab_high = _mm512_unpackhi_ps(v[0], v[1]);
    const __m512 cd_low = _mm512_unpacklo_ps(v[2], v[3]), cd_high = _mm512_unpackhi_ps(v[2], v[3]);
    out[0] = _mm512_shuffle_ps(ab_low, cd_low, 0x44);
    out[1] = _mm512_shuffle_ps(ab_low, cd_low, 0xee);
    out[2] = _mm512_shuffle_ps(ab_high, cd_high, 0x44);
    out[3] = _mm512_shuffle_ps(ab_high, cd_high, 0xee);
}

SPHM_INLINE sphm_row_packs sphm_row_of(const __m512 v[4]) {
    __m512 out[4];
    sphm_row_packs r;
    sphm_transpose_quarters(v, out);
    r.x = (sphm_lanes)out[0];
    r.y = (sphm_lanes)out[1];
    r.z = (sphm_lanes)out[2];
    r.w = (sphm_lanes)out[3];
    return r;
}

/* The even quarters of a, then those of b; or the odd ones. */
SPHM_INLINE sphm_lanes sphm_even_quarters(__m512 a, __m512 b) {
    return (sphm_lanes)_mm512_shuffle_f32x4(a, b, 0x88);
}
SPHM_INLINE sphm_lanes sphm_odd_quarters(__m512 a, __m512 b) {
    return (sphm_lanes)_mm512_shuffle_f32x4(a, b, 0xdd);
}

/* From the twins of entries 0 ... 7 and of 8 ... 15: entry k in low[k % 4], entry k + 4 behind it. */
SPHM_INLINE sphm_row_twins sphm_row_of_twins(const __m512 low[4], const __m512 high[4]) {
    __m512 a[4], b[4];
    sphm_row_twins r;
    sphm_transpose_quarters(low, a);
    sphm_transpose_quarters(high, b);
    r.first.x = sphm_even_quarters(a[0], b[0]);
    r.first.y = sphm_even_quarters(a[1], b[1]);
    r.first.z = sphm_even_quarters(a[2], b[2]);
    r.first.w = sphm_even_quarters(a[3], b[3]);
    r.second.x = sphm_odd_quarters(a[0], b[0]);
    r.second.y = sphm_odd_quarters(a[1], b[1]);
    r.second.z = sphm_odd_quarters(a[2], b[2]);
    r.second.w = sphm_odd_quarters(a[3], b[3]);
    return r;
}

SPHM_INLINE __m512 sphm_load_twins(const sphm_twin *a, const sphm_twin *b) {
    return _mm512_castpd_ps(
        _mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_load_pd((const double *)&a->first.x)),
                           _mm256_load_pd((const double *)&b->first.x), 1));
}

SPHM_INLINE __m512 sphm_load_packs(const sphm_pack *a, const sphm_pack *b, const sphm_pack *c,
                                   const sphm_pack *d) {
    __m512 v = _mm512_castps128_ps512(_mm_load_ps(&a->x));
    v = _mm512_insertf32x4(v, _mm_load_ps(&b->x), 1);
    v = _mm512_insertf32x4(v, _mm_load_ps(&c->x), 2);
    return _mm512_insertf32x4(v, _mm_load_ps(&d->x), 3);
}

SPHM_INLINE sphm_row_twins sphm_row_read_twins(const sphm_twin *twins, const int32_t *slot) {
    __m512 low[4], high[4];
#pragma GCC unroll 4
    for (int k = 0; k < 4; ++k) {
        low[k] = sphm_load_twins(&twins[slot[k]], &twins[slot[k + 4]]);
        high[k] = sphm_load_twins(&twins[slot[k + 8]], &twins[slot[k + 12]]);
    }
    return sphm_row_of_twins(low, high);
}

/* The first packs only. */
SPHM_INLINE sphm_row_packs sphm_row_read_first(const sphm_twin *twins, const int32_t *slot) {
    __m512 v[4];
#pragma GCC unroll 4
    for (int k = 0; k < 4; ++k)
        v[k] = sphm_load_packs(&twins[slot[k]].first, &twins[slot[k + 4]].first, &twins[slot[k + 8]].first,
                               &twins[slot[k + 12]].first);
    return sphm_row_of(v);
}

/* One array's values. */
SPHM_INLINE sphm_lanes sphm_row_gather(const sphm_real *values, const int32_t *slot) {
    return (sphm_lanes)_mm512_i32gather_ps(_mm512_loadu_si512(slot), values, 4);
}

/* The moving twin and the third pack. */
SPHM_INLINE void sphm_row_read_quads(const sphm_quad *quads, const int32_t *slot, sphm_row_twins *moving,
                                     sphm_row_packs *third) {
    __m512 low[4], high[4], rest[4];
#pragma GCC unroll 4
    for (int k = 0; k < 4; ++k) {
        const sphm_quad *a = &quads[slot[k]], *b = &quads[slot[k + 4]], *c = &quads[slot[k + 8]],
                        *d = &quads[slot[k + 12]];
        low[k] = sphm_load_twins(&a->moving, &b->moving);
        high[k] = sphm_load_twins(&c->moving, &d->moving);
        rest[k] = sphm_load_packs(&a->third, &b->third, &c->third, &d->third);
    }
    *moving = sphm_row_of_twins(low, high);
    *third = sphm_row_of(rest);
}

SPHM_INLINE sphm_row_packs sphm_row_read_fourth(const sphm_quad *quads, const int32_t *slot) {
    __m512 v[4];
#pragma GCC unroll 4
    for (int k = 0; k < 4; ++k)
        v[k] = sphm_load_packs(&quads[slot[k]].fourth, &quads[slot[k + 4]].fourth, &quads[slot[k + 8]].fourth,
                               &quads[slot[k + 12]].fourth);
    return sphm_row_of(v);
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

SPHM_INLINE void sphm_row_set(sphm_row_packs *r, int k, const sphm_pack *pack) {
    r->x[k] = pack->x;
    r->y[k] = pack->y;
    r->z[k] = pack->z;
    r->w[k] = pack->w;
}

SPHM_INLINE sphm_row_twins sphm_row_read_twins(const sphm_twin *twins, const int32_t *slot) {
    sphm_row_twins r;
    for (int k = 0; k < SPHM_LANES; ++k) {
        sphm_row_set(&r.first, k, &twins[slot[k]].first);
        sphm_row_set(&r.second, k, &twins[slot[k]].second);
    }
    return r;
}

SPHM_INLINE sphm_row_packs sphm_row_read_first(const sphm_twin *twins, const int32_t *slot) {
    sphm_row_packs r;
    for (int k = 0; k < SPHM_LANES; ++k)
        sphm_row_set(&r, k, &twins[slot[k]].first);
    return r;
}

SPHM_INLINE sphm_lanes sphm_row_gather(const sphm_real *values, const int32_t *slot) {
    sphm_lanes r;
    for (int k = 0; k < SPHM_LANES; ++k)
        r[k] = values[slot[k]];
    return r;
}

SPHM_INLINE void sphm_row_read_quads(const sphm_quad *quads, const int32_t *slot, sphm_row_twins *moving,
                                     sphm_row_packs *third) {
    for (int k = 0; k < SPHM_LANES; ++k) {
        sphm_row_set(&moving->first, k, &quads[slot[k]].moving.first);
        sphm_row_set(&moving->second, k, &quads[slot[k]].moving.second);
        sphm_row_set(third, k, &quads[slot[k]].third);
    }
}

SPHM_INLINE sphm_row_packs sphm_row_read_fourth(const sphm_quad *quads, const int32_t *slot) {
    sphm_row_packs r;
    for (int k = 0; k < SPHM_LANES; ++k)
        sphm_row_set(&r, k, &quads[slot[k]].fourth);
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

#if defined(__AVX512F__) && !defined(SPH_MUSCLE_DOUBLE)

/* a[k] + a[k + 8], then those four apart. */
SPHM_INLINE __m128 sphm_lanes_fold(sphm_lanes a) {
    const __m512d v = _mm512_castps_pd((__m512)a);
    const __m256 eight = _mm256_add_ps(_mm256_castpd_ps(_mm512_castpd512_pd256(v)),
                                       _mm256_castpd_ps(_mm512_extractf64x4_pd(v, 1)));
    return _mm_add_ps(_mm256_castps256_ps128(eight), _mm256_extractf128_ps(eight, 1));
}

/* The sums of four vectors, pairwise: the same order whatever the processor. Four at once, because the last
 * additions then fill a register: one at a time they took a tenth of the force sweep. */
SPHM_INLINE sphm_pack sphm_lanes_sums(sphm_lanes a, sphm_lanes b, sphm_lanes c, sphm_lanes d) {
    const __m128 fa = sphm_lanes_fold(a), fb = sphm_lanes_fold(b), fc = sphm_lanes_fold(c),
                 fd = sphm_lanes_fold(d);
    const __m128 ab = _mm_add_ps(_mm_unpacklo_ps(fa, fb), _mm_unpackhi_ps(fa, fb));
    const __m128 cd = _mm_add_ps(_mm_unpacklo_ps(fc, fd), _mm_unpackhi_ps(fc, fd));
    sphm_pack sums;
    _mm_storeu_ps(&sums.x, _mm_add_ps(_mm_movelh_ps(ab, cd), _mm_movehl_ps(cd, ab)));
    return sums;
}

#else

SPHM_INLINE sphm_real sphm_lanes_sum(sphm_lanes a) {
    sphm_real s[8];
    for (int k = 0; k < 8; ++k)
        s[k] = a[k] + a[k + 8];
    return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
}

SPHM_INLINE sphm_pack sphm_lanes_sums(sphm_lanes a, sphm_lanes b, sphm_lanes c, sphm_lanes d) {
    sphm_pack sums;
    sums.x = sphm_lanes_sum(a);
    sums.y = sphm_lanes_sum(b);
    sums.z = sphm_lanes_sum(c);
    sums.w = sphm_lanes_sum(d);
    return sums;
}

#endif

/* kernels/pairs.inc for 16 entries at a time: sphm_smooth_pair_lanes() and so on. */
#define NUMBER sphm_lanes
#define PACK sphm_row_packs
#define NAMED(name) name##_lanes
#define POSITIVE(a) sphm_lanes_positive(a)
#define INVERSE(a) sphm_lanes_inverse(a)
#define INVERSE_SQRT(a) sphm_lanes_inverse_sqrt(a)
#include "kernels/pairs.inc"

#endif
