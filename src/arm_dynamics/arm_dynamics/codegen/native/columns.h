/* SPDX-License-Identifier: Apache-2.0
 *
 * Columns side by side, WIDTH of them in a `column`: what the code of columns.py is made of. Of one arm they fill a vector
 * register; of LANES arms they are two, so that each coefficient, a number of every arm, is loaded for both at once.
 *
 * Required definitions: `real`, LANES and, for one arm, WIDTH, the number of doubles in a register.
 */
#if LANES == 1
typedef double column __attribute__((vector_size(8 * WIDTH)));
#define SPREAD(x) ((x) - (column){})
#else
#define WIDTH 2
struct column { real each[WIDTH]; };
static inline column SPREAD(real x) {
  column z;
  for (int i = 0; i < WIDTH; ++i) z.each[i] = x;
  return z;
}
#define EACH(x, op, y)                        \
  {                                           \
    column z;                                 \
    for (int i = 0; i < WIDTH; ++i) z.each[i] = x op y; \
    return z;                                 \
  }
#define OPERATOR(op)                                                                        \
  static inline column operator op(column x, column y) EACH(x.each[i], op, y.each[i])       \
  static inline column operator op(real x, column y) EACH(x, op, y.each[i])                 \
  static inline column operator op(column x, real y) EACH(x.each[i], op, y)
OPERATOR(+)
OPERATOR(-)
OPERATOR(*)
OPERATOR(/)
static inline column operator-(column x) EACH(, -, x.each[i])
#endif
