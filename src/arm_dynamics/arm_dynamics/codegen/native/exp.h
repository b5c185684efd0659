/* SPDX-License-Identifier: Apache-2.0
 *
 * The exponential function without branches, the same for one number and for a vector of them, like sincos.h. Error below
 * one unit in the last place; zero below e^-707 (1e-307), where results would soon lose digits.
 *
 * Required definitions: as for sincos.h, which comes before it; fmin and fmax.
 *
 * Argument reduction: Cody and Waite, Software Manual for the Elementary Functions, 1980: ln 2 in two parts, the first of
 * 32 bits, so that k * LN2_HIGH is exact. Polynomial: Taylor's, whose next term is 4e-18 at ln(2)/2, by Estrin's scheme.
 */
#ifndef LANES /* read alone, as editors do */
#include "scalar.h"
#else
#ifndef ARM_EXP_H
#define ARM_EXP_H

#define ONE_OVER_LN2 1.4426950408889634
#define LN2_HIGH 0.6931471803691238
#define LN2_LOW 1.9082149292705877e-10
#define ROUND_MAGIC_BITS 0x4338000000000000LL /* those of ROUND_MAGIC */
#define LEAST_EXPONENT -707.0
#define MOST_EXPONENT 710.0 /* the result overflows */

static inline real arm_exp(real x) {
  const real within = fmin(fmax(x, LEAST_EXPONENT), MOST_EXPONENT);
  const real shifted = within * ONE_OVER_LN2 + ROUND_MAGIC;
  const real k = shifted - ROUND_MAGIC;
  const real reduced = within - k * LN2_HIGH;
  const real correction = k * LN2_LOW;
  const real y = reduced - correction;
  const real tail = (reduced - y) - correction;
  const real z = y * y, z2 = z * z, z4 = z2 * z2;
  const real p = ((1.0 / 2 + y * (1.0 / 6)) + z * (1.0 / 24 + y * (1.0 / 120)))
                 + z2 * ((1.0 / 720 + y * (1.0 / 5040)) + z * (1.0 / 40320 + y * (1.0 / 362880)))
                 + z4 * ((1.0 / 3628800 + y * (1.0 / 39916800)) + z * (1.0 / 479001600 + y * (1.0 / 6227020800.0)));
  const real whole = 1.0 + (y + (z * p + tail));
  /* Half of 2^k, in the bits of the exponent: 2^1024 itself does not exist. */
  const bits power = (bits)((ubits)(AS_BITS(shifted) - ROUND_MAGIC_BITS + 1022) << 52);
  return (LEAST_EXPONENT <= x) * (whole * AS_REAL(power) * 2.0);
}

#endif
#endif
