/* SPDX-License-Identifier: Apache-2.0
 *
 * The door of an exported library to its tick. `library` stands for the library's name.
 *
 * Required definitions: library.h, tick.h and what it needs; LIBRARY_PERIOD (length of a tick), NZ (internal states), START
 * (the scene's initial state), OF_STATE (for each internal state the number of the state that it begins with, -1: zero),
 * TUNABLE (nominal tunable numbers), LOOP_TOLERANCE (residual up to which loops are closed), STOP_TOLERANCE (distance beyond
 * a stop that is rounding, relative to the position); with loops LOOPS (length of p in the generated `project`), and with
 * drives DRIVEN and the generated `torques`.
 */

#include "library.h"
#include "arm/tick.h"

/* The scene of this library. */
static const scene_t* const scene = &own_scene;

struct library_sim {
  double x[NX];      /* positions, velocities and internal states */
  double effort[NU]; /* command of the last tick, limits applied */
  control_t control;
  report_t report;
  double p[NP + 1]; /* tunable numbers */
};

size_t library_sim_size(void) { return sizeof(struct library_sim); }

int library_sim_joints(void) { return NU; }

double library_sim_period(void) { return LIBRARY_PERIOD; }

void library_sim_range(double* lower, double* upper) {
  for (int i = 0; i < NU; ++i) { /* 1e308 and beyond: NOWHERE of scene_source.py, no stop */
    lower[i] = scene->rigid && scene->rigid_stop[0][i] > -1e308 ? scene->rigid_stop[0][i] : -INFINITY;
    upper[i] = scene->rigid && scene->rigid_stop[1][i] < 1e308 ? scene->rigid_stop[1][i] : INFINITY;
  }
}

/* Whether no number is NaN or infinite. */
static int all_finite(const double* values, int count) {
  int finite = 1;
  for (int i = 0; i < count; ++i) finite &= values[i] - values[i] == 0.0;
  return finite;
}

/* Move joints that are beyond a rigid stop by rounding to the stop: 0 if one is farther. */
static int settle_on_stops(double* x) {
  for (int i = 0; scene->rigid && i < NU; ++i) {
    const double nearest = fmin(fmax(x[i], scene->rigid_stop[0][i]), scene->rigid_stop[1][i]);
    if (fabs(x[i] - nearest) > STOP_TOLERANCE * fmax(1.0, fabs(x[i]))) return 0;
    x[i] = nearest;
  }
  return 1;
}

/* Whether the bilateral constraints are satisfied. */
static int are_loops_closed(const struct library_sim* sim) {
#ifdef LOOPS
  double after[2 * NU], p[LOOPS + 1], gap[2];
  for (int i = 0; i < LOOPS; ++i) p[i] = i < NP ? sim->p[i] : 0.0;
  CALL(project, (sim->x, sim->x, p), (after, gap, gap + 1));
  return gap[0] <= LOOP_TOLERANCE && gap[1] <= LOOP_TOLERANCE;
#else
  (void)sim;
  return 1;
#endif
}

int library_sim_init(library_sim* sim, const double* q, const double* v) {
  static const double start[NX] = START;
  static const double nominal[NP + 1] = TUNABLE;
  static const int of_state[NZ + 1] = OF_STATE;
  const control_t control = {scene->tolerance, 0.0, 0.0, 0};
  static const report_t report = {0.0, 0, 0, 0};
  sim->report = report;
  sim->control = control;
  clear(sim->effort, NU);
  copy(sim->x, start, NX);
  for (int i = 0; i < NU && q; ++i) sim->x[i] = q[i];
  for (int i = 0; i < NU && v; ++i) sim->x[NU + i] = v[i];
  copy(sim->p, nominal, NP);
  if (!all_finite(sim->x, 2 * NU)) return LIBRARY_NOT_FINITE;
  if (!are_loops_closed(sim)) return LIBRARY_OPEN;
  if (!settle_on_stops(sim->x)) return LIBRARY_BEYOND_STOP;
#if EVENTS
  LOCAL_TICK(segment, 0, sim->p, NP);
  if (is_inside(scene, sim->x, &segment)) return LIBRARY_INSIDE_PLANE;
#endif
  for (int i = 0; i < NZ && (q || v); ++i) sim->x[2 * NU + i] = of_state[i] < 0 ? 0.0 : sim->x[of_state[i]];
  return LIBRARY_OK;
}

int library_sim_step(library_sim* sim, const double* command) {
  static const int code_of[] = {LIBRARY_DIVERGED, LIBRARY_DIVERGED, LIBRARY_UNDETERMINED, LIBRARY_INSIDE_PLANE};
  double acted[NU], after[NX];
  if (!all_finite(command, NU)) return LIBRARY_NOT_FINITE;
  if (!actuated_tick(scene, sim->x, command, sim->p, LIBRARY_PERIOD, &sim->control, &sim->report, acted, after))
    return code_of[sim->report.trouble]; /* which smooth ticks do not set */
  copy(sim->effort, acted, NU);
  copy(sim->x, after, NX);
  return LIBRARY_OK;
}

void library_sim_state(const library_sim* sim, double* q, double* v, double* effort) {
  for (int i = 0; i < NU && q; ++i) q[i] = sim->x[i];
  for (int i = 0; i < NU && v; ++i) v[i] = sim->x[NU + i];
#ifdef DRIVEN
  if (effort) CALL(torques, (sim->x, sim->effort), (effort, NULL));
#else
  for (int i = 0; i < NU && effort; ++i) effort[i] = sim->effort[i];
#endif
}

/* For library_sim_set, which is generated (export/tick.py): whether two texts are the same. */
static int is_same(const char* a, const char* b) {
  for (; *a && *a == *b; ++b) ++a;
  return *a == *b;
}

/* For library_sim_set: set the tunable number at a place. */
static int set_number(struct library_sim* sim, int place, double value) {
  if (!all_finite(&value, 1)) return LIBRARY_NOT_ALLOWED;
  sim->p[place] = value;
  return LIBRARY_OK;
}

const char* library_error_text(int code) {
  switch (code) {
    case LIBRARY_OK: return "no error";
    case LIBRARY_NOT_FINITE: return "a number is not finite; nothing has changed";
    case LIBRARY_OPEN: return "the closed loops are open at these positions, or opening at these velocities";
    case LIBRARY_BEYOND_STOP: return "a joint is beyond its stop";
    case LIBRARY_INSIDE_PLANE: return "a contact is inside its plane";
    case LIBRARY_UNKNOWN: return "there is no such parameter";
    case LIBRARY_NOT_ALLOWED: return "the parameter cannot have this value; it is kept";
    case LIBRARY_DIVERGED: return "the tick gives numbers that are not finite, or too large; the state before it is kept";
    case LIBRARY_UNDETERMINED:
      return "the forces of friction and contact are not determined; the state before the tick is kept";
    case LIBRARY_NO_DERIVATIVE:
      return "the tick has no derivative, or has an event or comes so close to one that this code does not find it";
    default: return "unknown code";
  }
}
