/* SPDX-License-Identifier: Apache-2.0
 *
 * Columns side by side, WIDTH of them in a `column`: what the code of columns.py is made of. Of one arm they are the four
 * numbers of a vector of 256 bits (in registers of 512 bits, eight are no faster); of LANES arms two, so that each
 * coefficient, a number of every arm, is loaded for both at once.
 *
 * Required definitions: `real` and LANES.
 */
#if LANES == 1
#define WIDTH 4
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
