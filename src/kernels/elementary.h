/* Elementary functions without branches or tables, so that loops that call them vectorise, and so that every
 * compiler and back end gets the same digits (libm's differ, and calls to it do not vectorise). Single
 * precision is within 3 units in the last place over the stated range; double falls back on libm. */
#ifndef SPHM_KERNELS_ELEMENTARY_H
#define SPHM_KERNELS_ELEMENTARY_H

#include <math.h>
#include <string.h>

#include "kernels/qualifiers.h"

#ifdef SPH_MUSCLE_DOUBLE

SPHM_FN double sphm_sqrt(double x) {
    return sqrt(x);
}
SPHM_FN double sphm_ln(double x) {
    return log(x);
}
SPHM_FN double sphm_exp(double x) {
    return exp(x < -700 ? -700 : x > 700 ? 700 : x);
}

#else

SPHM_FN float sphm_sqrt(float x) {
    return sqrtf(x);
}

SPHM_FN uint32_t sphm_bits_of(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

SPHM_FN float sphm_float_of(uint32_t bits) {
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* ln x for normal x > 0; anything else gives some number. x = 2^e m with sqrt(1/2) <= m < sqrt(2), and
 * ln m = 2 artanh s of s = (m - 1)/(m + 1), |s| < 0.172, to the ninth order. */
SPHM_FN float sphm_ln(float x) {
    const uint32_t bits = sphm_bits_of(x);
    const int32_t exponent = (int32_t)(bits - 0x3f3504f3u) >> 23;
    const float m = sphm_float_of(bits - ((uint32_t)exponent << 23)) - 1;
    const float s = m / (m + 2), z = s * s;
    const float series = z * (0.6666667f + z * (0.4f + z * (0.2857143f + z * 0.2222222f)));
    /* 2 s = m - s m keeps the digits of m, where ln x is small. */
    return (float)exponent * 0.693147182f + (m - s * (m - series));
}

/* e^x; x outside -87 ... 87 is taken as the end of that range. x = n ln 2 + r with |r| <= ln 2/2. */
SPHM_FN float sphm_exp(float x) {
    const float inside = x < -87.0f ? -87.0f : x > 87.0f ? 87.0f : x;
    const float shifted = inside * 1.44269504f + 12582912.0f; /* rounds to an integer in the low bits */
    const float n = shifted - 12582912.0f;
    const float r = (inside - n * 0.693359375f) + n * 2.12194440e-4f;
    const float e =
        1 + r * (1 + r * (0.5f +
                          r * (0.16666667f + r * (0.041666668f + r * (8.3333333e-3f + r * 1.3888889e-3f)))));
    return e * sphm_float_of((sphm_bits_of(shifted) << 23) + 0x3f800000u);
}

#endif

#endif
