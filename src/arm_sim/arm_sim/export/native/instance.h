/* SPDX-License-Identifier: Apache-2.0
 *
 * A functional mock-up unit: what FMI 2.0 and FMI 3.0 have in common. `library` stands for the name of the exported
 * library.
 *
 * Required definitions: FMI(name) (a function's name in the standard), log_t (the importer's logger), LOG(instance, status,
 * text) (a call of it); JOINTS, PARAMETERS (how many), NAMES (of the parameters), PERIOD (length of a tick in [s]), DEFAULTS
 * (of all variables), TOKEN (text that identifies the model description), FRAMES (how many take wrenches), and where there
 * are any JACOBIANS (their functions) and EXTERNAL (number of the parameter that is the first external torque).
 */
#pragma once
#include "library.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef FMI /* read alone */
typedef void (*log_t)(void* environment, const char* text);
#define FMI(name) fmi##name
#define LOG(i, status, text) (i)->logger((i)->environment, text)
#endif

#pragma GCC diagnostic ignored "-Wunused-parameter" /* the standard says what functions take */
#define EXPORT __attribute__((visibility("default")))
#define ALIGNED(size) (((size) + 63) / 64 * 64)
#define POINT_TOLERANCE 0.5   /* ticks by which a communication point may be beside the last tick: importers add up times */
#define LENGTH_TOLERANCE 1e-3 /* ticks by which a step may differ from whole ones: differences of large times are rounded */

/* Numbers of the variables. */
enum {
  TIME,
  COMMAND,
  WRENCH = COMMAND + JOINTS, /* force and moment on each frame, in axes of the world */
  POSITION = WRENCH + 6 * FRAMES,
  VELOCITY = POSITION + JOINTS,
  EFFORT = VELOCITY + JOINTS,
  START_POSITION = EFFORT + JOINTS,
  START_VELOCITY = START_POSITION + JOINTS,
  PARAMETER = START_VELOCITY + JOINTS,
  VARIABLES = PARAMETER + PARAMETERS
};

enum { OK, WARNING, DISCARD, ERROR, FATAL };

typedef unsigned int reference_t;

/* What is saved and restored, besides the simulations. */
typedef struct {
  double values[VARIABLES], start;
  int64_t ticks, initialized; /* ticks since the start; whether initialization is over */
  double step_command[JOINTS]; /* commands in the last step */
  int64_t ticks_of_last_step;  /* 0 if there was none */
} memory_t;

/* A unit, as the importer refers to it. */
typedef struct {
  void* place;                         /* of all that follows in memory, not aligned */
  memory_t* memory;                    /* and behind it the simulations: */
  library_sim *sim, *before, *scratch; /* now, at the beginning of the last step, and during its repetition */
  void* environment;                   /* of the importer */
  log_t logger;
} instance_t;

static const double defaults[VARIABLES] = DEFAULTS;

/* Report why a call has a status. */
static int report(const instance_t* i, int status, const char* text) {
  if (i->logger) LOG(i, status, text);
  return status;
}

static int fail(const instance_t* i, const char* text) { return report(i, ERROR, text); }

/* ERROR with its text for a code of the library. */
static int outcome(const instance_t* i, int code) { return code == LIBRARY_OK ? OK : fail(i, library_error_text(code)); }

EXPORT int FMI(Reset)(void* c) {
  memory_t* memory = ((instance_t*)c)->memory;
  memset(memory, 0, sizeof *memory);
  memcpy(memory->values, defaults, sizeof defaults);
  return OK;
}

/* An instance, or NULL, which the importer is told. */
static instance_t* new_instance(const char* token, void* environment, log_t logger) {
  const size_t size = ALIGNED(library_sim_size()), first = ALIGNED(sizeof(memory_t));
  const instance_t none = {.environment = environment, .logger = logger};
  instance_t* i = token && !strcmp(token, TOKEN) ? malloc(sizeof *i) : NULL;
  void* place = i ? calloc(1, 64 + first + 3 * size) : NULL;
  if (!place) {
    free(i);
    fail(&none, "out of memory, no co-simulation, or the token (GUID) is of another model description");
    return NULL;
  }
  char* begin = (char*)ALIGNED((uintptr_t)place);
  *i = (instance_t){.place = place, .memory = (memory_t*)begin, .environment = environment, .logger = logger};
  i->sim = (library_sim*)(begin + first);
  i->before = (library_sim*)(begin + first + size);
  i->scratch = (library_sim*)(begin + first + 2 * size);
  FMI(Reset)(i);
  return i;
}

EXPORT void FMI(FreeInstance)(void* c) {
  instance_t* i = c;
  if (i) free(i->place);
  free(i);
}

/* End of the last tick in [s]. */
static double end_time(const instance_t* i) { return i->memory->start + (double)i->memory->ticks * PERIOD; }

/* Read the variables that the simulation computes. */
static void read_outputs(instance_t* i) {
  double* values = i->memory->values;
  library_sim_state(i->sim, values + POSITION, values + VELOCITY, values + EFFORT);
  values[TIME] = end_time(i);
}

static int set_parameter(instance_t* i, int k, double value) {
  static const char* const names[PARAMETERS + 1] = {NAMES};
  return library_sim_set(i->sim, names[k], value);
}

/* Begin, or begin again, with the starting values; what is not given is that of the scene. */
static int begin_simulation(instance_t* i) {
  const double *values = i->memory->values, *q = values + START_POSITION, *v = values + START_VELOCITY;
  const int position_given = memcmp(q, defaults + START_POSITION, sizeof(double) * JOINTS) != 0;
  const int velocity_given = memcmp(v, defaults + START_VELOCITY, sizeof(double) * JOINTS) != 0;
  int code = library_sim_init(i->sim, position_given ? q : NULL, velocity_given ? v : NULL);
  for (int k = 0; k < PARAMETERS && code == LIBRARY_OK; ++k)
    if (values[PARAMETER + k] != defaults[PARAMETER + k]) code = set_parameter(i, k, values[PARAMETER + k]);
  i->memory->ticks = i->memory->ticks_of_last_step = 0;
  if (code == LIBRARY_OK) read_outputs(i);
  return outcome(i, code);
}

/* Read variables. */
static int get_values(instance_t* i, const reference_t* references, size_t count, double* values) {
  if (!i->memory->initialized && count && begin_simulation(i) != OK) return ERROR;
  for (size_t k = 0; k < count; ++k) {
    if (references[k] >= VARIABLES) return fail(i, "there is no variable with this value reference");
    values[k] = i->memory->values[references[k]];
  }
  return OK;
}

/* Set a variable. */
static int set_value(instance_t* i, reference_t reference, double value) {
  const int is_parameter = reference >= PARAMETER;
  if (reference >= VARIABLES) return fail(i, "there is no variable with this value reference");
  if (reference == TIME || (reference >= POSITION && reference < START_POSITION))
    return fail(i, "this variable is computed; inputs and parameters may be set");
  if (i->memory->initialized && reference >= START_POSITION && !is_parameter)
    return fail(i, "starting values may be set until initialization is over");
  if (!isfinite(value)) return outcome(i, LIBRARY_NOT_FINITE);
  if (i->memory->initialized && is_parameter) {
    const int code = set_parameter(i, (int)reference - PARAMETER, value);
    if (code != LIBRARY_OK) return outcome(i, code);
  }
  i->memory->values[reference] = value;
  return OK;
}

static int set_values(instance_t* i, const reference_t* references, size_t count, const double* values) {
  int status = OK;
  for (size_t k = 0; k < count && status == OK; ++k) status = set_value(i, references[k], values[k]);
  return status;
}

/* Let the wrenches on frames act in the next tick, as torques on the joints: J^T f besides the external torques. */
static int apply_wrenches(instance_t* i) {
  int code = LIBRARY_OK;
#if FRAMES
  static void (*const jacobians[FRAMES])(const double* q, double* J) = {JACOBIANS};
  double J[6][JOINTS], torque[JOINTS];
  memcpy(torque, i->memory->values + PARAMETER + EXTERNAL, sizeof torque);
  for (int f = 0; f < FRAMES; ++f) {
    jacobians[f](i->memory->values + POSITION, J[0]);
    for (int row = 0; row < 6; ++row)
      for (int k = 0; k < JOINTS; ++k) torque[k] += J[row][k] * i->memory->values[WRENCH + 6 * f + row];
  }
  for (int k = 0; k < JOINTS && code == LIBRARY_OK; ++k) code = set_parameter(i, EXTERNAL + k, torque[k]);
#endif
  return outcome(i, code);
}

/* Advance from a communication point, the end of the last tick, by a step of whole ticks. */
static int advance(instance_t* i, double point, double step) {
  const double offset = (point - end_time(i)) / PERIOD, ticks = floor(step / PERIOD + 0.5);
  char text[200];
  if (!i->memory->initialized) return fail(i, "initialization is not over");
  if (!(fabs(offset) < POINT_TOLERANCE) || !(fabs(step / PERIOD - ticks) <= LENGTH_TOLERANCE) || ticks < 1.0) {
    snprintf(text, sizeof text, "a step from %g s by %g s; allowed: from %g s, where the last one ended, by ticks of %g s",
             point, step, end_time(i), PERIOD);
    return fail(i, text);
  }
  memcpy(i->before, i->sim, library_sim_size());
  memcpy(i->memory->step_command, i->memory->values + COMMAND, sizeof i->memory->step_command);
  i->memory->ticks_of_last_step = 0;
  for (const int64_t goal = i->memory->ticks + (int64_t)ticks; i->memory->ticks < goal;) {
    if (apply_wrenches(i) != OK) return ERROR;
    const int code = library_sim_step(i->sim, i->memory->values + COMMAND);
    if (code != LIBRARY_OK) return outcome(i, code);
    ++i->memory->ticks;
    read_outputs(i);
  }
  i->memory->ticks_of_last_step = (int64_t)ticks;
  return OK;
}

#ifdef SLOPES /* never with FRAMES, see archive.py: a repeated step applies no wrenches */
enum { VARIED = LIBRARY_STATES + JOINTS + PARAMETERS };

/* Rows of derivatives times a column that is nonzero where the state, the commands and the parameters change. */
static void multiply(const double* rows, int count, const double* column, double* product) {
  for (int k = 0; k < count; ++k) {
    product[k] = 0.0;
    for (int j = 0; j < VARIED; ++j) product[k] += rows[k * VARIED + j] * column[j];
  }
}

/* Changes of the outputs at the end of the last step under changes of the commands held in it and of the parameters: the
 * step is repeated. */
static int differentiate_step(instance_t* i, double* column, double* outputs) {
  double of_state[LIBRARY_STATES * VARIED], of_effort[JOINTS * VARIED], state[LIBRARY_STATES];
  memcpy(i->scratch, i->before, library_sim_size());
  for (int64_t k = 0; k < i->memory->ticks_of_last_step; ++k) {
    int code = library_sim_sensitivities(i->scratch, i->memory->step_command, of_state, of_effort);
    if (code == LIBRARY_OK) code = library_sim_step(i->scratch, i->memory->step_command);
    if (code != LIBRARY_OK) return report(i, DISCARD, library_error_text(code));
    multiply(of_state, LIBRARY_STATES, column, state);
    multiply(of_effort, JOINTS, column, outputs + 2 * JOINTS);
    memcpy(column, state, sizeof state);
  }
  memcpy(outputs, column, 2 * JOINTS * sizeof *outputs);
  return OK;
}

/* Derivatives of outputs at the end of the last step by the inputs held in it, by parameters, and before the first step by
 * the starting values, times seeds. */
static int find_derivative(instance_t* i, const reference_t* unknowns, size_t count, const reference_t* knowns, size_t varied,
                           const double* seeds, double* results) {
  double column[VARIED] = {0.0}, outputs[3 * JOINTS] = {0.0};
  for (size_t k = 0; k < count; ++k)
    if (unknowns[k] < POSITION || unknowns[k] >= START_POSITION) return fail(i, "derivatives are those of outputs");
  for (size_t k = 0; k < varied; ++k) {
    const reference_t at = knowns[k];
    if (at >= COMMAND && at < WRENCH) column[LIBRARY_STATES + at - COMMAND] += seeds[k];
    else if (at >= PARAMETER && at < VARIABLES) column[LIBRARY_STATES + JOINTS + at - PARAMETER] += seeds[k];
    else if (at >= START_POSITION && at < PARAMETER && !i->memory->initialized) outputs[at - START_POSITION] += seeds[k];
    else if (at != TIME) return fail(i, "derivatives are those by inputs and parameters, and by time, which are zero");
  }
  if (i->memory->ticks_of_last_step) {
    const int status = differentiate_step(i, column, outputs);
    if (status != OK) return status;
  }
  for (size_t k = 0; k < count; ++k) results[k] = outputs[unknowns[k] - POSITION];
  return OK;
}
#endif

/* Bytes of what is saved: the memory, and the simulations now and at the beginning of the last step. */
static size_t state_size(void) { return ALIGNED(sizeof(memory_t)) + 2 * ALIGNED(library_sim_size()); }

/* Copy a state, into new memory unless `*state` is of an earlier call. */
static int copy_state(const instance_t* i, const void* from, void** state) {
  if (!*state) *state = malloc(state_size());
  if (!*state) return fail(i, "out of memory");
  memcpy(*state, from, state_size());
  return OK;
}

EXPORT int FMI(GetFMUState)(void* c, void** state) { return copy_state(c, ((instance_t*)c)->memory, state); }

EXPORT int FMI(SetFMUState)(void* c, const void* state) {
  if (!state) return fail(c, "this is no state of this unit");
  memcpy(((instance_t*)c)->memory, state, state_size());
  return OK;
}

EXPORT int FMI(FreeFMUState)(void* c, void** state) {
  free(*state);
  *state = NULL;
  return OK;
}

EXPORT int FMI(SerializedFMUStateSize)(void* c, const void* state, size_t* size) {
  *size = state_size();
  return OK;
}

EXPORT int FMI(SerializeFMUState)(void* c, const void* state, void* bytes, size_t size) {
  if (size < state_size()) return fail(c, "there is too little room for the state");
  memcpy(bytes, state, state_size());
  return OK;
}

EXPORT int FMI(DeserializeFMUState)(void* c, const void* bytes, size_t size, void** state) {
  return size == state_size() ? copy_state(c, bytes, state) : fail(c, "these bytes are no state of this unit");
}

EXPORT int FMI(ExitInitializationMode)(void* c) {
  instance_t* i = c;
  const int status = begin_simulation(i);
  i->memory->initialized = status == OK;
  return status;
}

/* What follows only answers, and declares no arguments that it does not look at. */
EXPORT int FMI(SetDebugLogging)(void* c) { return OK; }

EXPORT int FMI(Terminate)(void* c) { return OK; }

/* Variables of a type other than numbers, of which there are none. */
#define NO_VARIABLES(TYPE) \
  EXPORT int FMI(Get##TYPE)(void* c, const reference_t* references, size_t count) { return refuse_any(c, count); } \
  EXPORT int FMI(Set##TYPE)(void* c, const reference_t* references, size_t count) { return refuse_any(c, count); }

static int refuse_any(const instance_t* i, size_t count) { return count ? fail(i, "there is no variable of this type") : OK; }

/* A function of the standard that this unit does not provide, as its description says. */
#define NOT_PROVIDED(NAME) \
  EXPORT int FMI(NAME)(void* c) { return fail(c, "this unit does not provide " #NAME); }
#ifndef SLOPES
NOT_PROVIDED(GetDirectionalDerivative)
#endif
