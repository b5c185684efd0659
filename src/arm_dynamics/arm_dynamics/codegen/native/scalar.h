/* SPDX-License-Identifier: Apache-2.0
 *
 * One arm at a time: the generated code computes with plain doubles.
 */
#include <math.h>
#include <string.h>

#define LANES 1
#define LANE(x, i) (x)
typedef double real;
typedef long long bits;
typedef unsigned long long ubits;

static inline bits AS_BITS(real x) {
  bits b;
  memcpy(&b, &x, sizeof b);
  return b;
}
static inline real AS_REAL(bits b) {
  real x;
  memcpy(&x, &b, sizeof x);
  return x;
}
#define BEYOND(x, limit) (!(fabs(x) <= (limit)))

#include "sincos.h"

static inline real arm_sin(real x) { return BEYOND(x, REDUCIBLE) ? sin(x) : sin_shifted(x, 0); }
static inline real arm_cos(real x) { return BEYOND(x, REDUCIBLE) ? cos(x) : sin_shifted(x, 1); }

/* The library's versions are function calls, which are slow while the upper halves of vector registers are in use: seven
 * take a microsecond. If one argument is NaN, the first one is used. Numbers are never so large or small that squares
 * overflow or underflow.
 */
static inline real arm_fmin(real x, real y) { return y < x ? y : x; }
static inline real arm_fmax(real x, real y) { return y > x ? y : x; }
static inline real arm_hypot(real x, real y) { return sqrt(x * x + y * y); }

#define fmin arm_fmin
#define fmax arm_fmax
#include "exp.h"

#define sin arm_sin
#define cos arm_cos
#define exp arm_exp
#define hypot arm_hypot
