/* SPDX-License-Identifier: Apache-2.0
 *
 * Tangents in columns, see columns.h, and their propagation over ticks; where LANES > 1 a column holds those of LANES arms,
 * one per lane. Of many columns, columns_t says where they are and what is asked of them, matrices_t is one of its matrices.
 */

#pragma once
#include "derivatives/tangents.h"
#include "lanes/lanes.h"

/* A matrix for each arm, stored by rows of `count` numbers; that of arm i begins at numbers + i * size. */
typedef struct {
  double* numbers;
  long long size, count; /* size 0: the same matrix for all arms */
  const long long* of_lane; /* the arm of each lane */
} matrices_t;

/* Where the matrix of a lane's arm has an entry. */
static inline double* entry_at(const matrices_t* of, int lane, int row, long long column) {
  return of->numbers + of->of_lane[lane] * of->size + row * of->count + column;
}

/* Read the columns from `first` on, WIDTH of one arm or one of each lane; where there are fewer, others are zero. */
static inline void read_columns(column* to, const matrices_t* from, int rows, long long first) {
  const long long left = from->count - first;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < LANES; ++j) {
      const double* row = entry_at(from, j, i, first);
      if (LANES == 1 && left >= WIDTH) memcpy(to + i, row, sizeof *to);
      else
        for (int k = 0; k < WIDTH; ++k) LANE(PLACE(to[i], k), j) = k < left ? row[k] : 0.0;
    }
}

/* The inverse of read_columns; columns beyond `count` are not written. */
static inline void write_columns(const column* from, const matrices_t* to, int rows, long long first) {
  const long long left = to->count - first;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < LANES; ++j) {
      double* row = entry_at(to, j, i, first);
      if (LANES == 1 && left >= WIDTH) memcpy(row, from + i, sizeof *from);
      else
        for (int k = 0; k < WIDTH && k < left; ++k) row[k] = LANE(PLACE(from[i], k), j);
    }
}

/* Write the rows from `first` on, WIDTH of `rows`, whose entries are the places of `from`. */
static inline void write_rows(const column* from, const matrices_t* to, int rows, int first) {
  for (int j = 0; j < LANES; ++j)
    for (int k = 0; k < WIDTH && first + k < rows; ++k) {
      double* row = entry_at(to, j, first + k, 0);
#pragma GCC unroll 8
      for (int i = 0; i < to->count; ++i) row[i] = LANE(PLACE(from[i], k), j);
    }
}

/* Propagate tangents of the arms first … last-1 over their ticks.
 *
 * An arm is marked that comes near a stop or diverges; its results are invalid. So is one that has an event, or comes so
 * close to one that it might: its state is then that before this tick, and of one lane also its columns.
 */
EXPORTED void propagate_ticks(const scene_t* scene, const tangents_t* tangents, const arms_t* arms, long long first,
                              long long last, const columns_t* to);
