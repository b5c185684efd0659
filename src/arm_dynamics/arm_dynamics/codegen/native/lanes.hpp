/* SPDX-License-Identifier: Apache-2.0
 *
 * Many arms at a time, one in each lane of a vector register: `real` behaves like a double in generated code.
 *
 * Required definitions: LANES, the number of doubles in a register.
 */
#include <math.h>
#ifndef LANES /* read alone, as editors do */
#define LANES 4
#endif

/* CasADi's fmin and fmax call the library functions, overloaded below, only if C99 is declared. */
#define __STDC_VERSION__ 201112L

typedef double lanes_t __attribute__((vector_size(8 * LANES)));
typedef long long bits __attribute__((vector_size(8 * LANES)));
typedef unsigned long long ubits __attribute__((vector_size(8 * LANES)));

struct real {
  lanes_t v;
  real() = default;
  real(double x) : v(x - lanes_t{}) {}
  real(lanes_t x) : v(x) {}
  real& operator+=(real y) {
    v += y.v;
    return *this;
  }
  real& operator-=(real y) {
    v -= y.v;
    return *this;
  }
  real& operator*=(real y) {
    v *= y.v;
    return *this;
  }
  real& operator/=(real y) {
    v /= y.v;
    return *this;
  }
};

static inline real operator+(real x, real y) { return x.v + y.v; }
static inline real operator-(real x, real y) { return x.v - y.v; }
static inline real operator*(real x, real y) { return x.v * y.v; }
static inline real operator/(real x, real y) { return x.v / y.v; }
static inline real operator-(real x) { return -x.v; }
static inline real fmin(real x, real y) { return y.v < x.v ? y.v : x.v; }
static inline real fmax(real x, real y) { return y.v > x.v ? y.v : x.v; }
static inline real fabs(real x) { return (lanes_t)((bits)x.v & 0x7fffffffffffffffLL); }

/* Booleans are 1 or 0, as in C; the value that is not selected may be anything, even NaN. */
static inline real truth(bits b) { return b ? 1.0 - lanes_t{} : lanes_t{}; }
static inline real operator<(real x, real y) { return truth(x.v < y.v); }
static inline real operator<=(real x, real y) { return truth(x.v <= y.v); }
static inline real operator==(real x, real y) { return truth(x.v == y.v); }
static inline real operator!=(real x, real y) { return truth(x.v != y.v); }
static inline real operator!(real x) { return truth(x.v == 0.0); }
static inline real operator&&(real x, real y) { return truth((x.v != 0.0) & (y.v != 0.0)); }
static inline real operator||(real x, real y) { return truth((x.v != 0.0) | (y.v != 0.0)); }
static inline real if_else_zero(real condition, real x) { return condition.v != 0.0 ? x.v : lanes_t{}; }

static inline real sign(real x) { return x.v < 0.0 ? lanes_t{} - 1.0 : x.v > 0.0 ? lanes_t{} + 1.0 : x.v; }

static inline real sqrt(real x) {
  for (int i = 0; i < LANES; ++i) x.v[i] = __builtin_sqrt(x.v[i]);
  return x;
}

static inline real floor(real x) {
  for (int i = 0; i < LANES; ++i) x.v[i] = __builtin_floor(x.v[i]);
  return x;
}

static inline bits AS_BITS(real x) { return (bits)x.v; }
static inline real AS_REAL(bits b) { return (lanes_t)b; }

static inline bool BEYOND(real x, double limit) {
  const bits inside = fabs(x).v <= limit;
  long long outside = 0;
  for (int i = 0; i < LANES; ++i) outside |= ~inside[i];
  return outside;
}

#include "sincos.h"
#include "exp.h"

/* With some lanes out of range, which is rare, the library's functions replace those alone. */
static inline real far_sin(real x) {
  real y = sin_shifted(x, 0);
  for (int i = 0; i < LANES; ++i)
    if (!(__builtin_fabs(x.v[i]) <= REDUCIBLE)) y.v[i] = __builtin_sin(x.v[i]);
  return y;
}

static inline real far_cos(real x) {
  real y = sin_shifted(x, 1);
  for (int i = 0; i < LANES; ++i)
    if (!(__builtin_fabs(x.v[i]) <= REDUCIBLE)) y.v[i] = __builtin_cos(x.v[i]);
  return y;
}

static inline real arm_sin(real x) { return BEYOND(x, REDUCIBLE) ? far_sin(x) : sin_shifted(x, 0); }
static inline real arm_cos(real x) { return BEYOND(x, REDUCIBLE) ? far_cos(x) : sin_shifted(x, 1); }

#define sin arm_sin
#define cos arm_cos
#define exp arm_exp
#define casadi_real real
#define LANE(x, i) ((x).v[i])
