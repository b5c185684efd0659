/* SPDX-License-Identifier: Apache-2.0
 *
 * Loads and accelerations in given modes, and the mobility of the contacts.
 */

#pragma once
#include "modes/mode_vector.h"

/* Holding torques of sticking joints, relative to their level; forces, accelerations and grips of contacts; x'. */
typedef struct {
  real *all, *load, *force, *rate, *grip, *slope;
} loads_t;
#define LOADS (NU + 2 * MC + NC + NX)
#define NEARS (NU + MC) /* of these the loads and forces alone */

static inline loads_t loads_of(const scene_t* scene, real* all) {
  loads_t loads = {all, all, all + NU, all + NU + MC, all + NU + 2 * MC, all + NU + 2 * MC + NC};
  return loads;
}

/* Mobility of the contacts, of joints by contacts, and accelerations of contacts without forces. */
typedef struct {
  real *all, *W, *B, *free;
} inertia_t;
#define INERTIA (MC * MC + NU * MC + MC)

static inline inertia_t inertia_of(const scene_t* scene, real* all) {
  inertia_t inertia = {all, all, all + MC * MC, all + MC * MC + NU * MC};
  return inertia;
}

static inline void loads_at(const scene_t* scene, const real* x, const real* u, const real* p, const loads_t* loads) {
  CALL(scene->loads, (x, u, p), (loads->load, loads->force, loads->rate, loads->grip, 0, loads->slope));
}

static inline void inertia_at(const scene_t* scene, const real* x, const real* u, const real* p, const inertia_t* inertia) {
  CALL(scene->contact_inertia, (x, u, p), (inertia->W, inertia->B, inertia->free));
}

static inline void slope_at(const scene_t* scene, const real* x, const real* u, const real* p, real* slope) {
  CALL(scene->rhs, (x, u, p), (slope));
}
