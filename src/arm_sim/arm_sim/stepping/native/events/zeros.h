/* SPDX-License-Identifier: Apache-2.0
 *
 * Memory set to zero, for structures of eight-byte numbers and pointers. C and C++ have no initializer in common that says so
 * without a warning.
 */

#pragma once
#include "scene.h"

#include <string.h>

static inline void set_zero(void* memory, size_t size) {
  const double zero = 0.0;
  for (size_t i = 0; i < size; i += sizeof zero) memcpy((char*)memory + i, &zero, sizeof zero);
}
