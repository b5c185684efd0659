/* SPDX-License-Identifier: Apache-2.0
 *
 * Contact points in their planes' axes.
 */

#pragma once
#include "scene.h"

/* Where the contact points are.
 *
 * place: of each point, along the normal and two tangents: the first number is its gap.
 * speed: its velocity, likewise.
 * size:  of each point, the lengths that add up to its gap, whose rounding is relative to them.
 */
typedef struct {
  real *all, *place, *speed, *size;
} geometry_t;
#define PLACES (2 * MC + NC)

static inline geometry_t geometry_of(const scene_t* scene, const real* numbers) {
  real* all = (real*)numbers;
  geometry_t geometry = {all, all, all + MC, all + 2 * MC};
  return geometry;
}

/* Compute a geometry_t. */
static inline void find_places(const scene_t* scene, const real* x, real* places) {
  if (NC) CALL(scene->contact_geometry, (x), (places, places + MC, places + 2 * MC));
}
