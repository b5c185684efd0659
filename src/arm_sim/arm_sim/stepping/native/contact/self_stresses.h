/* SPDX-License-Identifier: Apache-2.0
 *
 * Self-stresses: combinations of the reactions of what is held that cause no motion, and the sets of parts that share them.
 */

#pragma once
#include "contact/several_contacts.h"
#include "numerics/linear.h"

#define PARTS (NU + NC)         /* joints, then contacts */
#define FORCES (MC + NU)        /* reactions: those of contacts, then those of joints */
#define SHARES (NM + FORCES)    /* forces of constraints, and reactions */
#define CANCELLATION 1e-12 /* entry of a self-stress, or column of the balance, that is rounding, relative to the largest */

/* The balance of forces at a state. */
typedef struct {
  real* push;     /* joint torques per force of a constraint, and per unknown force of a contact */
  real* reaction; /* holding torques of the least norm */
  real* capacity; /* largest holding torques that dry friction bears, pushed forwards and backwards */
  real* drift;    /* accelerations of the constraints' rows without acceleration of the joints */
} statics_t;
#define STATICS (NU * (NM + MC) + 3 * NU + NM)

static statics_t statics_of(const scene_t* scene, real* numbers) {
  real* reaction = numbers + NU * (NM + MC);
  statics_t statics = {numbers, reaction, reaction + NU, reaction + 3 * NU};
  return statics;
}

/* A part: a joint or contact that is held, a contact that only presses, or none of these.
 *
 * held:     whether it is a joint or contact that is held, or a contact that only presses
 * sticks:   whether it is a contact that sticks
 * force:    reaction: of a contact as in loads_t, of a joint its holding torque and nothing else
 * lower:    lower bound of the holding torque, or of the normal force
 * upper:    upper bound of the holding torque, or of the normal force
 * fraction: of its normal force, up to which a contact sticks
 */
typedef struct {
  int held, sticks;
  double force[3], lower, upper, fraction;
} part_t;
static const part_t loose = {0, 0, {0.0, 0.0, 0.0}, 0.0, 0.0, 0.0};

/* Self-stresses, and the sets of parts that share them. */
typedef struct {
  int count;
  int *set, *set_of_stress; /* of each part and of each stress, from 1 to count; 0 for what statics determines */
  double* stress;
} stresses_t;

/* Declare self-stresses and their arrays. */
#define LOCAL_STRESSES(stresses) \
  int stresses##_set[PARTS], stresses##_sets[SHARES]; \
  double stresses##_room[FORCES * SHARES]; \
  stresses_t stresses = {0, stresses##_set, stresses##_sets, stresses##_room}

static int part_of(const scene_t* scene, int reaction) { return reaction < MC ? NU + reaction / 3 : reaction - MC; }

/* The balance with columns of size 1, or zero where a force is not transmitted or moves nothing. */
static void scale_columns(const scene_t* scene, const statics_t* statics, const part_t* parts, double* T, double* size) {
  double widest = 0.0;
  for (int j = 0; j < SHARES; ++j) {
    size[j] = 0.0;
    for (int i = 0; i < NU; ++i) {
      T[SHARES * i + j] = j < NM + MC ? statics->push[i + NU * j] : j - NM - MC == i && parts[i].held ? -1.0 : 0.0;
      size[j] = fmax(size[j], fabs(T[SHARES * i + j]));
    }
    widest = fmax(widest, size[j]);
  }
  for (int j = 0; j < SHARES; ++j) {
    if (size[j] <= CANCELLATION * widest) size[j] = 0.0;
    for (int i = 0; i < NU; ++i) T[SHARES * i + j] = size[j] > 0.0 ? T[SHARES * i + j] / size[j] : 0.0;
  }
}

static void relabel(int* labels, int count, int from, int to) {
  for (int k = 0; k < count; ++k)
    if (labels[k] == from) labels[k] = to;
}

/* Number the sets of parts that share self-stresses: each is numbered as the last of its stresses, which takes over the sets
 * that it meets. */
static void find_sets(const scene_t* scene, stresses_t* stresses) {
  for (int i = 0; i < PARTS; ++i) stresses->set[i] = 0;
  for (int j = 0; j < stresses->count; ++j) {
    const int number = j + 1;
    stresses->set_of_stress[j] = number;
    for (int i = 0; i < FORCES; ++i) {
      const int other = stresses->set[part_of(scene, i)];
      if (stresses->stress[FORCES * j + i] == 0.0 || other == number) continue;
      if (other) {
        relabel(stresses->set, PARTS, other, number);
        relabel(stresses->set_of_stress, j, other, number);
      }
      stresses->set[part_of(scene, i)] = number;
    }
  }
}

/* Self-stresses: a basis of the combinations of reactions that move nothing. */
static void find_stresses(const scene_t* scene, const statics_t* statics, const part_t* parts, stresses_t* stresses) {
  double T[NU * SHARES], size[SHARES];
  int basic[NU];
  scale_columns(scene, statics, parts, T, size);
  for (int i = 0; i < NU; ++i) basic[i] = -1;
  eliminate(NU, SHARES, T, 0, NM, basic); /* forces of constraints have no limits: they follow from the others */
  eliminate(NU, SHARES, T, NM, SHARES, basic);
  stresses->count = 0;
  for (int j = NM; j < SHARES; ++j) {
    int free = size[j] > 0.0;
    for (int i = 0; i < NU; ++i) free &= basic[i] != j;
    if (!free) continue;
    double* stress = stresses->stress + FORCES * stresses->count++;
    for (int i = 0; i < FORCES; ++i) stress[i] = 0.0;
    stress[j - NM] = 1.0 / size[j];
    for (int i = 0; i < NU; ++i)
      if (basic[i] >= NM && fabs(T[SHARES * i + j]) > CANCELLATION)
        stress[basic[i] - NM] = -T[SHARES * i + j] / size[basic[i]];
  }
  find_sets(scene, stresses);
}
