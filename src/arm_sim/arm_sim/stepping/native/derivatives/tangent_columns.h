/* SPDX-License-Identifier: Apache-2.0
 *
 * Tangents in columns, see columns.h; where LANES > 1 a column holds those of LANES arms, one per lane. Matrices of columns are
 * stored by rows, `count` numbers per row.
 */

#pragma once
#include "derivatives/tangents.h"

#include <string.h>

/* The matrix of arm j (of_lane[j]) begins at matrix + of_lane[j] * size. */
#if LANES == 1
static inline void take(column* to, const double* matrix, const long long* of_lane, long long size, int rows, long long count,
                        long long first) {
  for (int i = 0; i < rows; ++i) {
    const double* row = matrix + of_lane[0] * size + i * count + first;
    if (count - first >= WIDTH) memcpy(&to[i], row, sizeof(column));
    else
      for (int j = 0; j < WIDTH; ++j) to[i][j] = j < count - first ? row[j] : 0.0;
  }
}

static inline void put(const column* from, double* matrix, const long long* of_lane, long long size, int rows, long long count,
                       long long first) {
  for (int i = 0; i < rows; ++i) {
    double* row = matrix + of_lane[0] * size + i * count + first;
    if (count - first >= WIDTH) memcpy(row, &from[i], sizeof(column));
    else
      for (int j = 0; j < count - first; ++j) row[j] = from[i][j];
  }
}
#else
static inline void take(column* to, const double* matrix, const long long* of_lane, long long size, int rows, long long count,
                        long long first) {
  for (int i = 0; i < rows; ++i) {
    const double* row = matrix + i * count + first;
    if (!size) to[i] = row[0]; /* the same for all arms */
    else
      for (int j = 0; j < LANES; ++j) LANE(to[i], j) = row[of_lane[j] * size];
  }
}

static inline void put(const column* from, double* matrix, const long long* of_lane, long long size, int rows, long long count,
                       long long first) {
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < LANES; ++j) matrix[of_lane[j] * size + i * count + first] = LANE(from[i], j);
}
#endif

/* WIDTH rows of a matrix of `rows` rows, from entries that lie side by side. */
static inline void put_rows(const column* from, double* matrix, const long long* of_lane, long long size, int rows, int count,
                            int first) {
  for (int j = 0; j < LANES; ++j)
    for (int k = 0; k < WIDTH && first + k < rows; ++k) {
      double* row = matrix + of_lane[j] * size + (first + k) * count;
#pragma GCC unroll 8
      for (int i = 0; i < count; ++i) row[i] = LANE(PLACE(from[i], k), j);
    }
}
