/* SPDX-License-Identifier: Apache-2.0
 *
 * What a tick with events will ask for if no event occurs, computed beforehand for several arms at a time.
 *
 * The engine of one arm looks its questions up here and computes those that are not answered, such as all that follow from
 * an event. Answers are those of the same functions for the same bits: the motion does not depend on what is foreseen.
 *
 * Required definitions: NX, NU, NP, ND, NQ, NC (as for modes.c).
 */

#define MODES (ND + NQ + 5 * NC) /* numbers in modes_t after the tunable ones, and in loads_t */
#define LOADS (NU + 7 * NC)

typedef struct {
  double x[NX], u[NU], p[NP + MODES]; /* beginning of a tick, its command, and its probable modes */
  double length;                      /* of the tick */
  long long rests;                    /* whether loads and slopes will be asked for */
  double slope[NX], loads[LOADS];     /* at the beginning ... */
  double after[NX], loads_after[LOADS]; /* ... and at the end */
} foreseen_t;

/* Functions of the engine of one arm: find p and `rests` of a tick; make it, return 0 if it cannot be computed. */
typedef struct {
  void (*foresee)(foreseen_t* tick);
  int (*tick_as_foreseen)(const foreseen_t* tick, double* after);
} engine_t;
