/* SPDX-License-Identifier: Apache-2.0
 *
 * Calls between generated code and the engine: functions of a scene, and what their libraries export.
 */
#pragma once
#include "numerics/vectors.h"

/* A generated function: arguments, results, and its work space, see CasADi. */
typedef int equation_t(const real** arg, real** res, long long int* iw, real* w, int mem);

/* Arrays of a call: arguments or results, and integers of the work space. Python: scene_source.py. */
enum capacity { ARGUMENT_CAPACITY = 128, INTEGER_CAPACITY = 8 };
#define LIST(...) __VA_ARGS__

/* Call a function of `scene`: CALL(equation, (arguments), (results)); results that are not asked for are null.
 * Loops, not memcpy: that would read single stores back in one wide load, which waits for them. */
#define CALL(equation, arguments, results) \
  do { \
    const real* const inputs_[] = {LIST arguments}; \
    real* const outputs_[] = {LIST results}; \
    const real* arg[ARGUMENT_CAPACITY]; \
    real *res[ARGUMENT_CAPACITY], w[SZ_W] __attribute__((aligned(64))); \
    long long int iw[INTEGER_CAPACITY]; \
    for (size_t k_ = 0; k_ < sizeof inputs_ / sizeof *inputs_; ++k_) arg[k_] = inputs_[k_]; \
    for (size_t k_ = 0; k_ < sizeof outputs_ / sizeof *outputs_; ++k_) res[k_] = outputs_[k_]; \
    (equation)(arg, res, iw, w, 0); \
  } while (0)

#ifndef EXPORTED
#ifdef __cplusplus
#define EXPORTED extern "C" __attribute__((visibility("default")))
#else
#define EXPORTED __attribute__((visibility("default")))
#endif
#endif
