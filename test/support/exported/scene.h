/* SPDX-License-Identifier: Apache-2.0
 *
 * What an exported library defines, for reading its other files alone, as editors and checks of them do: a scene of two joints
 * with dry friction and stops, a drive with a state, a bilateral constraint and two contacts, under error control.
 */
#pragma once
#pragma GCC diagnostic ignored "-Wunused-parameter"
#define NX 5
#define NU 2
#define NP 3
#define NC 2
#define NM 1
#define ND 2
#define NQ 2
#define NK 1
#define NT 1
#define SZ_W 256
#include "derivatives/tangents.h"
#include "modes/prediction.h"

static const scene_t own_scene;
static const tangents_t slope_own_tangents;
int slope_differentiate_tick(const scene_t* scene, const tangents_t* tangents, const engine_t* engine, const double* x,
                             const double* r, const double* p, double h, double* after, double* slopes);
equation_t project, torques, acting_torques, servo, effort_slopes;

#define LIBRARY_PERIOD 1e-3
#define NZ 1
#define START {0.0, 0.0, 0.0, 0.0, 0.0}
#define OF_STATE {-1}
#define TUNABLE {0.0, 0.0, -9.81}
#define LOOP_TOLERANCE 1e-11
#define STOP_TOLERANCE 1e-9
#define LOOPS 24
#define DRIVEN 1
