/* SPDX-License-Identifier: Apache-2.0
 *
 * Single precision: the type of numbers in generated code, and libm's functions of this type.
 */
#include <math.h>

#ifdef casadi_real /* what comes before is in double precision */
#undef casadi_real
#undef casadi_int
#undef sin
#undef cos
#undef exp
#undef hypot
#undef fmin
#undef fmax
#endif
#define casadi_real float
#define casadi_int long long
#define sin sinf
#define cos cosf
#define asin asinf
#define acos acosf
#define atan atanf
#define atan2 atan2f
#define tanh tanhf
#define exp expf
#define log logf
#define pow powf
#define sqrt sqrtf
#define hypot hypotf
#define fabs fabsf
#define floor floorf
#define fmin fminf
#define fmax fmaxf
