/* SPDX-License-Identifier: Apache-2.0
 *
 * A functional mock-up unit for co-simulation by FMI 2.0 ("Functional Mock-up Interface for Model Exchange and
 * Co-Simulation", version 2.0.4, section 4). `library` stands for the name of the exported library.
 */
#define FMI(name) fmi2##name
#define fmi2GetFMUState fmi2GetFMUstate
#define fmi2SetFMUState fmi2SetFMUstate
#define fmi2FreeFMUState fmi2FreeFMUstate
#define fmi2SerializedFMUStateSize fmi2SerializedFMUstateSize
#define fmi2SerializeFMUState fmi2SerializeFMUstate
#define fmi2DeserializeFMUState fmi2DeSerializeFMUstate
#define LOG(i, status, text) (i)->logger((i)->environment, "library_fmu", status, "error", "%s", text)
typedef void (*log_t)(void* environment, const char* name, int status, const char* category, const char* text, ...);
#include "instance.h"

/* What the importer offers. */
typedef struct {
  log_t logger;
  void* (*allocate)(size_t count, size_t size);
  void (*release)(void* memory);
  void (*finished)(void* environment, int status);
  void* environment;
} callbacks_t;

enum { CO_SIMULATION = 1, LAST_SUCCESSFUL_TIME = 2 };

EXPORT const char* fmi2GetTypesPlatform(void) { return "default"; }

EXPORT const char* fmi2GetVersion(void) { return "2.0"; }

EXPORT void* fmi2Instantiate(const char* name, int type, const char* token, const char* resources,
                             const callbacks_t* callbacks, int visible, int logging) {
  static const callbacks_t no_callbacks;
  if (!callbacks) callbacks = &no_callbacks;
  return new_instance(type == CO_SIMULATION ? token : NULL, callbacks->environment, callbacks->logger);
}

EXPORT int fmi2SetupExperiment(void* c, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
  ((instance_t*)c)->memory->start = start;
  return OK;
}

EXPORT int fmi2EnterInitializationMode(void* c) { return begin_simulation(c); }

EXPORT int fmi2GetReal(void* c, const reference_t* references, size_t count, double* values) {
  return get_values(c, references, count, values);
}

EXPORT int fmi2SetReal(void* c, const reference_t* references, size_t count, const double* values) {
  return set_values(c, references, count, values);
}

EXPORT int fmi2DoStep(void* c, double point, double step, int final) { return advance(c, point, step); }

EXPORT int fmi2GetRealStatus(void* c, int kind, double* value) {
  if (kind != LAST_SUCCESSFUL_TIME) return fail(c, "the only status is the last successful time");
  *value = end_time(c);
  return OK;
}

#ifdef SLOPES
EXPORT int fmi2GetDirectionalDerivative(void* c, const reference_t* unknowns, size_t count, const reference_t* knowns,
                                        size_t varied, const double* seeds, double* results) {
  return find_derivative(c, unknowns, count, knowns, varied, seeds, results);
}
#endif
NO_VARIABLES(Integer)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)
NOT_PROVIDED(CancelStep)
NOT_PROVIDED(GetStatus)
NOT_PROVIDED(GetIntegerStatus)
NOT_PROVIDED(GetBooleanStatus)
NOT_PROVIDED(GetStringStatus)
NOT_PROVIDED(GetRealOutputDerivatives)
NOT_PROVIDED(SetRealInputDerivatives)
