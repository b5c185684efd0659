/* SPDX-License-Identifier: Apache-2.0
 *
 * Views: structures that name the parts of an array of numbers.
 */
#pragma once
#include "numerics/vectors.h"

/* Declare a view and its array, which has an element more, since arrays of no elements are an extension. */
#define LOCAL(type, name, view_of, count) \
  real name##_room[(count) + 1]; \
  type name = view_of(scene, name##_room)
