/* SPDX-License-Identifier: Apache-2.0
 *
 * Columns side by side, WIDTH of them in a `column`: what the code of columns.py is made of. Of one arm they are the four
 * numbers of a vector of 256 bits (in registers of 512 bits, eight are no faster). Of LANES arms one column at a time fills
 * the registers; with two, more values are alive than there are registers.
 *
 * Required definitions: `real` and LANES.
 */
#ifndef LANES /* read alone, as editors do */
#include "scalar.h"
#endif
#if LANES == 1
#define WIDTH 4
typedef double column __attribute__((vector_size(8 * WIDTH)));
static const column no_column = {0.0, 0.0, 0.0, 0.0};
#define SPREAD(x) ((x) - no_column)
#define PLACE(x, k) ((x)[k])
#else
#define WIDTH 1
typedef real column;
#define SPREAD(x) (x)
#define PLACE(x, k) (x)
#endif
