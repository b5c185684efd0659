/* SPDX-License-Identifier: Apache-2.0
 *
 * A functional mock-up unit for co-simulation by FMI 2.0 ("Functional Mock-up Interface for Model Exchange and
 * Co-Simulation", version 2.0.4, section 4). `library` stands for the name of the exported library.
 */
#include "instance.h"

typedef unsigned int reference_t;
typedef void (*log_t)(void* environment, const char* name, int status, const char* category, const char* text, ...);

/* What the importer offers. */
typedef struct {
  log_t logger;
  void* (*allocate)(size_t count, size_t size);
  void (*release)(void* memory);
  void (*finished)(void* environment, int status);
  void* environment;
} callbacks_t;

enum { CO_SIMULATION = 1, LAST_SUCCESSFUL_TIME = 2 };

/* Call the importer's logger through the pointer that it has given. */
static void complain(const instance_t* i, int status, const char* text) {
  log_t logger;
  memcpy(&logger, &i->logger, sizeof logger);
  if (logger) logger(i->environment, i->name, status, "error", "%s", text);
}

EXPORT const char* fmi2GetTypesPlatform(void) { return "default"; }

EXPORT const char* fmi2GetVersion(void) { return "2.0"; }

EXPORT int fmi2SetDebugLogging(void* c, int on, size_t count, const char* const* categories) { return OK; }

EXPORT void* fmi2Instantiate(const char* name, int type, const char* token, const char* resources,
                             const callbacks_t* callbacks, int visible, int logging) {
  instance_t* i = type == CO_SIMULATION ? new_instance(token) : NULL;
  if (!i) {
    if (callbacks && callbacks->logger)
      callbacks->logger(callbacks->environment, name, ERROR, "error", "%s",
                        "out of memory, no co-simulation, or the GUID is of another model description");
    return NULL;
  }
  i->complain = complain;
  i->name = "library_fmu";
  if (callbacks) {
    i->environment = callbacks->environment;
    memcpy(&i->logger, &callbacks->logger, sizeof callbacks->logger);
  }
  return i;
}

EXPORT void fmi2FreeInstance(void* c) { free_instance(c); }

EXPORT int fmi2SetupExperiment(void* c, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
  instance_t* i = c;
  i->memory.start = start;
  return OK;
}

EXPORT int fmi2EnterInitializationMode(void* c) { return begin(c); }

EXPORT int fmi2ExitInitializationMode(void* c) { return end_initialization(c); }

EXPORT int fmi2Terminate(void* c) { return OK; }

EXPORT int fmi2Reset(void* c) {
  forget(c);
  return OK;
}

EXPORT int fmi2GetReal(void* c, const reference_t* references, size_t count, double* values) {
  return get_values(c, references, count, values);
}

EXPORT int fmi2SetReal(void* c, const reference_t* references, size_t count, const double* values) {
  return set_values(c, references, count, values);
}

EXPORT int fmi2DoStep(void* c, double point, double time, int final) { return advance(c, point, time); }

EXPORT int fmi2GetFMUstate(void* c, void** state) { return save(c, state); }

EXPORT int fmi2SetFMUstate(void* c, void* state) { return restore(c, state, state_size()); }

EXPORT int fmi2FreeFMUstate(void* c, void** state) { return discard_state(state); }

EXPORT int fmi2SerializedFMUstateSize(void* c, void* state, size_t* size) { return measure_state(size); }

EXPORT int fmi2SerializeFMUstate(void* c, void* state, char* bytes, size_t size) { return serialize(c, state, bytes, size); }

EXPORT int fmi2DeSerializeFMUstate(void* c, const char* bytes, size_t size, void** state) {
  return deserialize(c, bytes, size, state);
}

EXPORT int fmi2GetStatus(void* c, int kind, int* value) {
  return fail(c, "steps end before fmi2DoStep returns: there is no status");
}

EXPORT int fmi2GetRealStatus(void* c, int kind, double* value) {
  if (kind != LAST_SUCCESSFUL_TIME) return fail(c, "the only status is the last successful time");
  *value = reached(c);
  return OK;
}

EXPORT int fmi2CancelStep(void* c) { return fail(c, "steps end before fmi2DoStep returns: none can be cancelled"); }

/* Variables of other types, and statuses of these types. */
#define NO_VARIABLES(NAME, TYPE) \
  EXPORT int fmi2Get##NAME(void* c, const reference_t* references, size_t count, TYPE* values) { return none(c, count); } \
  EXPORT int fmi2Set##NAME(void* c, const reference_t* references, size_t count, const TYPE* values) { \
    return none(c, count); \
  } \
  EXPORT int fmi2Get##NAME##Status(void* c, int kind, TYPE* value) { \
    return fail(c, "the only status is the last successful time"); \
  }
NO_VARIABLES(Integer, int)
NO_VARIABLES(Boolean, int)
NO_VARIABLES(String, char*)

/* Functions of the standard that this unit does not provide, as its description says. */
#define NOT_PROVIDED(NAME) \
  EXPORT int fmi2##NAME(void* c) { return fail(c, "this unit does not provide fmi2" #NAME); }
#ifdef SLOPES
EXPORT int fmi2GetDirectionalDerivative(void* c, const reference_t* unknowns, size_t count, const reference_t* knowns,
                                        size_t varied, const double* seeds, double* found) {
  return find_derivative(c, unknowns, count, knowns, varied, seeds, found);
}
#else
NOT_PROVIDED(GetDirectionalDerivative)
#endif
NOT_PROVIDED(GetRealOutputDerivatives)
NOT_PROVIDED(SetRealInputDerivatives)
