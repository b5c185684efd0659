/* SPDX-License-Identifier: Apache-2.0
 *
 * One arm at a time: the generated code computes with plain doubles.
 */
#include <math.h>
#include <string.h>

typedef double real;
typedef long long bits;

static inline bits AS_BITS(real x) { bits b; memcpy(&b, &x, sizeof b); return b; }
static inline real AS_REAL(bits b) { real x; memcpy(&x, &b, sizeof x); return x; }
#define BEYOND(x, limit) (!(fabs(x) <= (limit)))
static inline real far_sin(real x) { return sin(x); }
static inline real far_cos(real x) { return cos(x); }

#include "sincos.h"

#define sin arm_sin
#define cos arm_cos
#define LANES 1
#define LANE(x, i) (x)
