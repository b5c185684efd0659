/* SPDX-License-Identifier: Apache-2.0
 *
 * A functional mock-up unit for co-simulation by FMI 3.0 ("Functional Mock-up Interface Specification", version 3.0.2,
 * section 4). `library` stands for the name of the exported library.
 */
#include "instance.h"

#include <stdbool.h>

typedef unsigned int reference_t;
typedef void (*log_t)(void* environment, int status, const char* category, const char* text);

/* Call the importer's logger through the pointer that it has given. */
static void complain(const instance_t* i, int status, const char* text) {
  log_t logger;
  memcpy(&logger, &i->logger, sizeof logger);
  if (logger) logger(i->environment, status, "error", text);
}

EXPORT const char* fmi3GetVersion(void) { return "3.0"; }

EXPORT int fmi3SetDebugLogging(void* c, bool on, size_t count, const char* const* categories) { return OK; }

EXPORT void* fmi3InstantiateCoSimulation(const char* name, const char* token, const char* resources, bool visible,
                                         bool logging, bool events, bool early, const reference_t* required, size_t count,
                                         void* environment, log_t logger, void* update) {
  instance_t* i = new_instance(token);
  if (!i) {
    if (logger) logger(environment, ERROR, "error", "out of memory, or the token is of another model description");
    return NULL;
  }
  i->complain = complain;
  i->environment = environment;
  memcpy(&i->logger, &logger, sizeof logger);
  return i;
}

EXPORT void* fmi3InstantiateModelExchange(const char* name, const char* token, const char* resources, bool visible,
                                          bool logging, void* environment, log_t logger) {
  return NULL;
}

EXPORT void* fmi3InstantiateScheduledExecution(const char* name, const char* token, const char* resources, bool visible,
                                               bool logging, void* environment, log_t logger, void* update, void* lock,
                                               void* unlock) {
  return fmi3InstantiateModelExchange(name, token, resources, visible, logging, environment, logger);
}

EXPORT void fmi3FreeInstance(void* c) { free_instance(c); }

EXPORT int fmi3EnterInitializationMode(void* c, bool has_tolerance, double tolerance, double start, bool has_stop,
                                       double stop) {
  instance_t* i = c;
  i->memory.start = start;
  return begin(i);
}

EXPORT int fmi3ExitInitializationMode(void* c) { return end_initialization(c); }

EXPORT int fmi3Terminate(void* c) { return OK; }

EXPORT int fmi3Reset(void* c) {
  forget(c);
  return OK;
}

EXPORT int fmi3GetFloat64(void* c, const reference_t* references, size_t count, double* values, size_t size) {
  return size == count ? get_values(c, references, count, values) : fail(c, "as many values as references are expected");
}

EXPORT int fmi3SetFloat64(void* c, const reference_t* references, size_t count, const double* values, size_t size) {
  return size == count ? set_values(c, references, count, values) : fail(c, "as many values as references are expected");
}

EXPORT int fmi3DoStep(void* c, double point, double time, bool final, bool* events, bool* terminate, bool* early,
                      double* last) {
  const int found = advance(c, point, time);
  if (events) *events = false;
  if (terminate) *terminate = false;
  if (early) *early = false;
  if (last) *last = reached(c);
  return found;
}

EXPORT int fmi3GetFMUState(void* c, void** state) { return save(c, state); }

EXPORT int fmi3SetFMUState(void* c, void* state) { return restore(c, state, state_size()); }

EXPORT int fmi3FreeFMUState(void* c, void** state) { return discard_state(state); }

EXPORT int fmi3SerializedFMUStateSize(void* c, void* state, size_t* size) { return measure_state(size); }

EXPORT int fmi3SerializeFMUState(void* c, void* state, uint8_t* bytes, size_t size) {
  return serialize(c, state, bytes, size);
}

EXPORT int fmi3DeserializeFMUState(void* c, const uint8_t* bytes, size_t size, void** state) {
  return deserialize(c, bytes, size, state);
}

/* Variables of other types. */
#define NO_VARIABLES(NAME, TYPE) \
  EXPORT int fmi3Get##NAME(void* c, const reference_t* references, size_t count, TYPE* values, size_t size) { \
    return none(c, count); \
  } \
  EXPORT int fmi3Set##NAME(void* c, const reference_t* references, size_t count, const TYPE* values, size_t size) { \
    return none(c, count); \
  }
NO_VARIABLES(Float32, float)
NO_VARIABLES(Int8, int8_t)
NO_VARIABLES(UInt8, uint8_t)
NO_VARIABLES(Int16, int16_t)
NO_VARIABLES(UInt16, uint16_t)
NO_VARIABLES(Int32, int32_t)
NO_VARIABLES(UInt32, uint32_t)
NO_VARIABLES(Int64, int64_t)
NO_VARIABLES(UInt64, uint64_t)
NO_VARIABLES(Boolean, bool)
NO_VARIABLES(String, char*)

EXPORT int fmi3GetBinary(void* c, const reference_t* references, size_t count, size_t* sizes, void* values, size_t size) {
  return none(c, count);
}

EXPORT int fmi3SetBinary(void* c, const reference_t* references, size_t count, const size_t* sizes, const void* values,
                         size_t size) {
  return none(c, count);
}

EXPORT int fmi3GetClock(void* c, const reference_t* references, size_t count, bool* values) { return none(c, count); }

EXPORT int fmi3SetClock(void* c, const reference_t* references, size_t count, const bool* values) { return none(c, count); }

/* Functions of the standard that this unit does not provide, as its description says. */
#define NOT_PROVIDED(NAME) \
  EXPORT int fmi3##NAME(void* c) { return fail(c, "this unit does not provide fmi3" #NAME); }
NOT_PROVIDED(ActivateModelPartition)
NOT_PROVIDED(CompletedIntegratorStep)
NOT_PROVIDED(EnterConfigurationMode)
NOT_PROVIDED(EnterContinuousTimeMode)
NOT_PROVIDED(EnterEventMode)
NOT_PROVIDED(EnterStepMode)
NOT_PROVIDED(EvaluateDiscreteStates)
NOT_PROVIDED(ExitConfigurationMode)
NOT_PROVIDED(GetAdjointDerivative)
NOT_PROVIDED(GetContinuousStateDerivatives)
NOT_PROVIDED(GetContinuousStates)
#ifdef SLOPES
EXPORT int fmi3GetDirectionalDerivative(void* c, const reference_t* unknowns, size_t count, const reference_t* knowns,
                                        size_t varied, const double* seeds, size_t given, double* found, size_t wanted) {
  if (given != varied || wanted != count) return fail(c, "as many numbers as references are expected");
  return find_derivative(c, unknowns, count, knowns, varied, seeds, found);
}
#else
NOT_PROVIDED(GetDirectionalDerivative)
#endif
NOT_PROVIDED(GetEventIndicators)
NOT_PROVIDED(GetIntervalDecimal)
NOT_PROVIDED(GetIntervalFraction)
NOT_PROVIDED(GetNominalsOfContinuousStates)
NOT_PROVIDED(GetNumberOfContinuousStates)
NOT_PROVIDED(GetNumberOfEventIndicators)
NOT_PROVIDED(GetNumberOfVariableDependencies)
NOT_PROVIDED(GetOutputDerivatives)
NOT_PROVIDED(GetShiftDecimal)
NOT_PROVIDED(GetShiftFraction)
NOT_PROVIDED(GetVariableDependencies)
NOT_PROVIDED(SetContinuousStates)
NOT_PROVIDED(SetIntervalDecimal)
NOT_PROVIDED(SetIntervalFraction)
NOT_PROVIDED(SetShiftDecimal)
NOT_PROVIDED(SetShiftFraction)
NOT_PROVIDED(SetTime)
NOT_PROVIDED(UpdateDiscreteStates)
