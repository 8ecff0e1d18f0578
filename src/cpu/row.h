/* Reading a neighbour row into vectors.
 *
 * Sweeps keep what they need of a particle in packs of four values, one load each, and turn 16 packs into 4
 * vectors. That costs a quarter of gathering from 4 arrays (AVX-512 gathers 16 values in some 26 cycles).
 * Rows are read SPHM_CHUNK entries at a time into a buffer that stays in the first-level cache; the
 * arithmetic then runs over plain arrays, which any compiler turns into vector instructions. */
#ifndef SPHM_CPU_ROW_H
#define SPHM_CPU_ROW_H

#ifdef __AVX512F__
#include <immintrin.h>
#endif

#include "core/neighbours.h"

#define SPHM_CHUNK 128 /* a multiple of SPHM_ROW_ALIGN */

typedef struct sphm_pack {
    sphm_real x, y, z, w;
} sphm_pack;

/* One chunk of packs, taken apart. */
typedef struct sphm_row_buffer {
    sphm_real x[SPHM_CHUNK] __attribute__((aligned(64)));
    sphm_real y[SPHM_CHUNK] __attribute__((aligned(64)));
    sphm_real z[SPHM_CHUNK] __attribute__((aligned(64)));
    sphm_real w[SPHM_CHUNK] __attribute__((aligned(64)));
} sphm_row_buffer;

#if defined(__AVX512F__) && !defined(SPH_MUSCLE_DOUBLE)

/* Packs slot[0], slot[4], slot[8], slot[12] in the four quarters of a vector. */
static inline __m512 sphm_load_quarters(const sphm_pack *packs, const int32_t *slot) {
    __m512 v = _mm512_castps128_ps512(_mm_load_ps(&packs[slot[0]].x));
    v = _mm512_insertf32x4(v, _mm_load_ps(&packs[slot[4]].x), 1);
    v = _mm512_insertf32x4(v, _mm_load_ps(&packs[slot[8]].x), 2);
    return _mm512_insertf32x4(v, _mm_load_ps(&packs[slot[12]].x), 3);
}

/* Fills entries 0 ... n - 1 of the buffer; n is a multiple of 16. */
static inline void sphm_row_read(const sphm_pack *packs, const int32_t *slot, size_t n,
                                 sphm_row_buffer *buffer) {
    for (size_t k = 0; k < n; k += 16) {
        const __m512 a = sphm_load_quarters(packs, slot + k), b = sphm_load_quarters(packs, slot + k + 1);
        const __m512 c = sphm_load_quarters(packs, slot + k + 2), d = sphm_load_quarters(packs, slot + k + 3);
        const __m512 ab_low = _mm512_unpacklo_ps(a, b), ab_high = _mm512_unpackhi_ps(a, b);
        const __m512 cd_low = _mm512_unpacklo_ps(c, d), cd_high = _mm512_unpackhi_ps(c, d);
        _mm512_store_ps(buffer->x + k, _mm512_shuffle_ps(ab_low, cd_low, 0x44));
        _mm512_store_ps(buffer->y + k, _mm512_shuffle_ps(ab_low, cd_low, 0xee));
        _mm512_store_ps(buffer->z + k, _mm512_shuffle_ps(ab_high, cd_high, 0x44));
        _mm512_store_ps(buffer->w + k, _mm512_shuffle_ps(ab_high, cd_high, 0xee));
    }
}

#else

static inline void sphm_row_read(const sphm_pack *packs, const int32_t *slot, size_t n,
                                 sphm_row_buffer *buffer) {
    for (size_t k = 0; k < n; ++k) {
        const sphm_pack pack = packs[slot[k]];
        buffer->x[k] = pack.x;
        buffer->y[k] = pack.y;
        buffer->z[k] = pack.z;
        buffer->w[k] = pack.w;
    }
}

#endif

#endif
