/* SPDX-License-Identifier: Apache-2.0
 *
 * A functional mock-up unit for co-simulation by FMI 3.0 ("Functional Mock-up Interface Specification", version 3.0.2,
 * section 4). `library` stands for the name of the exported library.
 */
#define FMI(name) fmi3##name
#define LOG(i, status, text) (i)->logger((i)->environment, status, "error", text)
typedef void (*log_t)(void* environment, int status, const char* category, const char* text);
#include "instance.h"

#include <stdbool.h>

EXPORT const char* fmi3GetVersion(void) { return "3.0"; }

EXPORT void* fmi3InstantiateCoSimulation(const char* name, const char* token, const char* resources, bool visible,
                                         bool logging, bool events, bool early, const reference_t* required, size_t count,
                                         void* environment, log_t logger, void* update) {
  return new_instance(token, environment, logger);
}

EXPORT void* fmi3InstantiateModelExchange(void) { return NULL; }

EXPORT void* fmi3InstantiateScheduledExecution(void) { return NULL; }

EXPORT int fmi3EnterInitializationMode(void* c, bool has_tolerance, double tolerance, double start, bool has_stop,
                                       double stop) {
  ((instance_t*)c)->memory->start = start;
  return begin_simulation(c);
}

EXPORT int fmi3GetFloat64(void* c, const reference_t* references, size_t count, double* values, size_t size) {
  return size == count ? get_values(c, references, count, values) : fail(c, "as many values as references are expected");
}

EXPORT int fmi3SetFloat64(void* c, const reference_t* references, size_t count, const double* values, size_t size) {
  return size == count ? set_values(c, references, count, values) : fail(c, "as many values as references are expected");
}

EXPORT int fmi3DoStep(void* c, double point, double step, bool final, bool* events, bool* terminate, bool* early,
                      double* last) {
  const int status = advance(c, point, step);
  if (events) *events = false;
  if (terminate) *terminate = false;
  if (early) *early = false;
  if (last) *last = end_time(c);
  return status;
}

#ifdef SLOPES
EXPORT int fmi3GetDirectionalDerivative(void* c, const reference_t* unknowns, size_t count, const reference_t* knowns,
                                        size_t varied, const double* seeds, size_t seed_count, double* results,
                                        size_t result_count) {
  if (seed_count != varied || result_count != count) return fail(c, "as many numbers as references are expected");
  return find_derivative(c, unknowns, count, knowns, varied, seeds, results);
}
#endif
NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)
NO_VARIABLES(Binary)
NO_VARIABLES(Clock)
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
