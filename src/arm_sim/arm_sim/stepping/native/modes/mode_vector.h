/* SPDX-License-Identifier: Apache-2.0
 *
 * Modes of joints and contacts, in the vector of parameters that the generated functions take.
 */

#pragma once
#include "scene.h"

/* Entries of p for a contact, as numbers for the generated functions. Python: Modes.contact; equations/contact.py: Mode. */
typedef struct {
  real closed;    /* 1 if it is closed, 0 if it is open */
  real sticks;    /* 1 if a closed one sticks, 0 if it slides */
  real along[2];  /* direction of sliding in the two tangents */
  real fixed;     /* 1 if it keeps that direction, 0 if the direction follows the motion */
} contact_mode_t;
#define CONTACT_MODE ((int)(sizeof(contact_mode_t) / sizeof(real))) /* its numbers */

/* The vector p of the generated functions. Python: Modes. */
typedef struct {
  real* all;       /* the vector: the tunable numbers of the scene, then all modes in the order of these members */
  real* direction; /* of joints: -1 and 1 slide, 0 is held by friction or a stop; without friction sliding is 1 */
  real* pressed;   /* of joints: -1 and 1 press against the lower and the upper compliant stop, else 0 */
  real* switches;  /* of drives and cords: 1 where a comparison holds, else 0 */
  contact_mode_t* contact;
} modes_t;
#define FIRST_CONTACT (NP + ND + NQ + NK) /* place in p of the modes of contacts */
#define P_LENGTH (FIRST_CONTACT + CONTACT_MODE * NC)
#define MODES (P_LENGTH - NP)

static inline modes_t modes_of(const scene_t* scene, real* p) {
  modes_t modes = {p, p + NP, p + NP + ND, p + NP + ND + NQ, (contact_mode_t*)(p + FIRST_CONTACT)};
  return modes;
}

/* Whether a contact is closed, by the vector p of one arm. */
static inline int any_closed(const scene_t* scene, const double* p) {
  int any = 0;
  for (int k = 0; k < NC; ++k) any |= p[FIRST_CONTACT + CONTACT_MODE * k] != 0.0;
  return any;
}

/* Whether every joint slides and every contact is apart, by the vector p of one arm. */
static inline int all_moves(const scene_t* scene, const double* p) {
  int moves = !any_closed(scene, p);
  for (int i = 0; i < ND; ++i) moves &= p[NP + i] != 0.0;
  return moves;
}

/* Declare modes that begin as others. */
#define LOCAL_MODES(name, like) \
  LOCAL(modes_t, name, modes_of, P_LENGTH); \
  copy(name.all, (like).all, P_LENGTH)
