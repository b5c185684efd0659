/* SPDX-License-Identifier: Apache-2.0
 *
 * Sine and cosine without branches, the same for one number (double) and for a vector of them, so that an arm in a vector
 * lane gets bitwise the same result as a single arm. Error below one unit in the last place; next to multiples of pi/2,
 * where the result nearly vanishes, below 1e-20.
 *
 * Required definitions: `real` (double or a vector of doubles), `bits` and `ubits` (64-bit integers, signed and not, or
 * vectors of them), AS_BITS(x) and AS_REAL(b), which reinterpret one as the other.
 *
 * Argument reduction: Cody and Waite, Software Manual for the Elementary Functions, 1980: pi/2 in two parts, the first
 * of 33 bits, so that k * PIO2_HIGH is exact for |k| < 2^20. Polynomials: minimax by Remez exchange with 60 digits,
 * relative error 3.4e-18 for sine and 4.7e-20 for cosine on [-pi/4, pi/4].
 */
#ifndef LANES /* read alone, as editors do */
#include "scalar.h"
#else
#ifndef ARM_SINCOS_H
#define ARM_SINCOS_H

#define TWO_OVER_PI 0.63661977236758134
#define PIO2_HIGH 1.5707963267341256
#define PIO2_LOW 6.077100506506192e-11
#define ROUND_MAGIC 6755399441055744.0 /* 1.5 * 2^52: adding it rounds to an integer in the low bits */
#define REDUCIBLE 1.0e6 /* largest argument: beyond it, the library's functions are called */

static inline real sin_polynomial(real x, real tail) {
  const real z = x * x;
  const real p = 0.008333333333322425
                 + z
                       * (-0.00019841269829817097
                          + z * (2.7557313695263568e-06 + z * (-2.5050758657396315e-08 + z * 1.5896828091189524e-10)));
  const real cube = z * x;
  return x - ((z * (0.5 * tail - cube * p) - tail) - cube * -0.16666666666666632);
}

static inline real cos_polynomial(real x, real tail) {
  const real z = x * x;
  const real p =
      z
      * (0.0416666666666666
         + z
               * (-0.0013888888888874138
                  + z
                        * (2.480158728949189e-05
                           + z * (-2.7557314355251614e-07 + z * (2.087572368483827e-09 + z * -1.1359669852359625e-11)))));
  const real half = 0.5 * z;
  const real one = 1.0 - half;
  return one + (((1.0 - one) - half) + (z * p - x * tail));
}

/* sin(x + quarters * pi/2) for |x| up to REDUCIBLE. */
static inline real sin_shifted(real x, const long long quarters) {
  const real shifted = x * TWO_OVER_PI + ROUND_MAGIC;
  const real k = shifted - ROUND_MAGIC;
  const bits quadrant = AS_BITS(shifted) + quarters;
  const real reduced = x - k * PIO2_HIGH;
  const real correction = k * PIO2_LOW;
  const real y = reduced - correction;
  const real tail = (reduced - y) - correction;
  const bits odd = -(quadrant & 1);
  const bits sign = (bits)((ubits)(quadrant & 2) << 62); /* a signed shift may not reach the sign */
  const bits s = AS_BITS(sin_polynomial(y, tail)), c = AS_BITS(cos_polynomial(y, tail));
  return AS_REAL(((s & ~odd) | (c & odd)) ^ sign);
}

#endif
#endif
