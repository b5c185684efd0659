/* SPDX-License-Identifier: Apache-2.0
 *
 * Tangents in columns, see columns.h, and their propagation over ticks; where LANES > 1 a column holds those of LANES arms,
 * one per lane. Of many columns, columns_t says where they are and what is asked of them, layout_t is that of one matrix.
 */

#pragma once
#include "derivatives/tangents.h"
#include "lanes/lanes.h"

/* Where matrices of arms lie, one for each, stored by rows of `count` numbers. */
typedef struct {
  long long size, count;    /* the matrix of arm i begins after i * size numbers; 0: the same matrix for all arms */
  const long long* of_lane; /* the arm of each lane */
} layout_t;

/* Place of an entry in the matrix of a lane's arm. */
static inline long long entry_of(const layout_t* at, int lane, int row, long long column) {
  return at->of_lane[lane] * at->size + row * at->count + column;
}

/* Read the columns from `first` on, WIDTH of one arm or one of each lane; where there are fewer, others are zero. */
static inline void read_columns(column* to, const double* from, const layout_t* at, int rows, long long first) {
  const long long left = at->count - first;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < LANES; ++j) {
      const double* row = from + entry_of(at, j, i, first);
      if (LANES == 1 && left >= WIDTH) memcpy(to + i, row, sizeof *to);
      else
        for (int k = 0; k < WIDTH; ++k) LANE(PLACE(to[i], k), j) = k < left ? row[k] : 0.0;
    }
}

/* The inverse of read_columns; columns beyond `count` are not written. */
static inline void write_columns(const column* from, double* to, const layout_t* at, int rows, long long first) {
  const long long left = at->count - first;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < LANES; ++j) {
      double* row = to + entry_of(at, j, i, first);
      if (LANES == 1 && left >= WIDTH) memcpy(row, from + i, sizeof *from);
      else
        for (int k = 0; k < WIDTH && k < left; ++k) row[k] = LANE(PLACE(from[i], k), j);
    }
}

/* Write the rows from `first` on, WIDTH of `rows`, whose entries are the places of `from`. */
static inline void write_rows(const column* from, double* to, const layout_t* at, int rows, int first) {
  for (int j = 0; j < LANES; ++j)
    for (int k = 0; k < WIDTH && first + k < rows; ++k) {
      double* row = to + entry_of(at, j, first + k, 0);
#pragma GCC unroll 8
      for (int i = 0; i < at->count; ++i) row[i] = LANE(PLACE(from[i], k), j);
    }
}

/* Propagate tangents of the arms first … last-1 over their ticks.
 *
 * An arm is marked that comes near a stop or diverges; its results are invalid. So is one that has an event, or comes so
 * close to one that it might: its state is then that before this tick, and of one lane also its columns.
 */
EXPORTED void propagate_ticks(const scene_t* scene, const tangents_t* tangents, const arms_t* arms, long long first,
                              long long last, const columns_t* to);
