/* SPDX-License-Identifier: Apache-2.0
 *
 * Loads and accelerations in given modes, and the mobility of the contacts.
 */

#pragma once
#include "modes/mode_vector.h"

/* What acts and moves in given modes.
 *
 * load:  holding torque of each sticking joint, scaled such that the joint slips at its static level.
 * force: of contacts, three numbers each: along the normal and two tangents.
 * rate:  accelerations of contacts, likewise.
 * grip:  acceleration of each contact's gap per normal force of its own; not positive where friction jams it.
 * slope: x'.
 */
typedef struct {
  real *all, *load, *force, *rate, *grip, *slope;
} loads_t;
#define NEAR_LOADS (NU + MC) /* numbers of `load` and `force`, which come first */
#define LOADS (NEAR_LOADS + MC + NC + NX)

static inline loads_t loads_of(const scene_t* scene, real* all) {
  real* rate = all + NEAR_LOADS;
  loads_t loads = {all, all, all + NU, rate, rate + MC, rate + MC + NC};
  return loads;
}

/* Mobility of the contacts, in matrices that lie column by column.
 *
 * W:    J M^-1 J^T, the Delassus matrix: accelerations of contacts per force, MC by MC.
 * B:    M^-1 J^T: accelerations of joints per force of a contact, NU by MC.
 * free: accelerations of contacts without forces, MC.
 */
typedef struct {
  real *all, *W, *B, *free;
} mobility_t;
#define MOBILITY (MC * MC + NU * MC + MC)

static inline mobility_t mobility_of(const scene_t* scene, real* all) {
  mobility_t mobility = {all, all, all + MC * MC, all + MC * MC + NU * MC};
  return mobility;
}

static inline void loads_at(const scene_t* scene, const real* x, const real* u, const real* p, const loads_t* loads) {
  CALL(scene->loads, (x, u, p), (loads->load, loads->force, loads->rate, loads->grip, 0, loads->slope));
}

static inline void mobility_at(const scene_t* scene, const real* x, const real* u, const real* p, const mobility_t* mobility) {
  CALL(scene->contact_mobility, (x, u, p), (mobility->W, mobility->B, mobility->free));
}

static inline void slope_at(const scene_t* scene, const real* x, const real* u, const real* p, real* slope) {
  CALL(scene->rhs, (x, u, p), (slope));
}
