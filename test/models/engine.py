# SPDX-License-Identifier: Apache-2.0
"""The engine's C as it ships, piece by piece: the cone solver, the search for events, impacts.

Each is compiled from the files of ``stepping/native`` with a few exported lines behind them.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.codegen import Kernel, compiler
from arm_sim.integrators.selection import choose
from arm_sim.plant.actuation import actuation
from arm_sim.plant.plant import Plant
from arm_sim.stepping.adaptive import LARGEST, SubstepControl
from arm_sim.stepping.engine import INCLUDED, engine_source
from arm_sim.stepping.stepper import tick_functions

APART, SLIDES, STICKS, UNSOLVABLE = range(4)
_CALLBACK = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_double, ctypes.POINTER(ctypes.c_double)
)

_VISIBLE = '#include "scalar.h"\n#pragma GCC visibility push(default)\n'
_CONES = """
#define NX 1
#include "contact/friction_cones.h"
int solve_cones(const double* W, const double* c, const double* mu, const double* given,
                const int* slides, const int* allowed, int* state, double* force,
                double* direction) {
  cones_t cones = {.W = W, .c = c, .friction = mu, .holding = mu};
  answer_t answers[NC];
  for (int k = 0; k < NC; ++k) {
    cones.slides[k] = slides[k];
    cones.allowed[k] = allowed[k];
    for (int i = 0; i < 2; ++i) cones.given[k][i] = given[2 * k + i];
  }
  const int found = several(&cones, answers);
  for (int k = 0; k < NC; ++k) {
    state[k] = answers[k].state;
    for (int i = 0; i < 3; ++i) force[3 * k + i] = answers[k].force[i];
    for (int i = 0; i < 2; ++i) direction[2 * k + i] = answers[k].direction[i];
  }
  return found;
}
int solve_cone(const double* W, const double* c, double mu, const double* given, double* force) {
  double block[3][3];
  own_block(W, 0, block);
  const answer_t answer = single(block, c, mu, mu, given);
  for (int i = 0; i < 3; ++i) force[i] = answer.force[i];
  return answer.state;
}
"""
_SEARCH = """
#define NX 1
#include "events/event_location.h"
double locate(void (*values_at)(const void*, double, double*), int count, double h,
              const double* at_h, double nothing, double* room) {
  return first_positive(values_at, 0, count, h, at_h, nothing, room);
}
"""
_DECAY = """
#define NX 2
#define NU 1
#define SZ_W 1
#define SZ_IW 1
#define SZ_ARG 4
#define SZ_RES 3
typedef long long casadi_int;
/* x' = -u x by Heun's method, its error that of Euler's; only the first number is a position. */
static int attempt(const real** arg, real** res, casadi_int* iw, real* w, int mem) {
  const real *x = arg[0], u = arg[1][0], h = arg[3][0];
  double worst = 0.0;
  for (int i = 0; i < 2; ++i) {
    res[0][i] = x[i] * (1.0 - u * h + 0.5 * u * u * h * h);
    worst = fmax(worst, fabs(0.5 * u * u * h * h * x[i]));
  }
  *res[1] = worst, *res[2] = fabs(0.5 * u * u * h * h * x[0]);
  return 0;
}
#define step attempt
#include "motion/flow.h"
int decay(const real* x, const real* u, double h, control_t* control, real* after) {
  return flow(x, u, 0, h, control, after);
}
"""
_SCENE = """
static const real still[NU];

EXPORTED double impulse_at(const real* x, const double* rebound, double* W, double* B,
                           double* before, double* impulse) {
  geometry_t geometry;
  inertia_t inertia;
  memory_t memory = {0};
  segment_t segment = {.u = still, .memory = &memory};
  for (int k = 0; k < NC; ++k) segment.contact[k].touching = 1;
  for (int i = 0; i < ND; ++i) segment.p.direction[i] = 1.0;
  find_geometry(x, &segment, &geometry);
  find_inertia(x, &segment, &inertia);
  for (int i = 0; i < MC; ++i) before[i] = geometry.speed[i];
  for (int i = 0; i < MC * MC; ++i) W[i] = inertia.W[i];
  for (int i = 0; i < NU * MC; ++i) B[i] = inertia.B[i];
  jump_t jump = {.touching = 1};
  for (int k = 0; k < NC; ++k) jump.rebound[k] = rebound[k];
  jump.gain = find_impulse(&inertia, before, 1.0, segment.contact, &jump);
  for (int i = 0; i < MC; ++i) impulse[i] = jump.impulse[i];
  return jump.gain;
}
EXPORTED double hit(real* x, int rebounds) {
  memory_t memory = {0};
  segment_t segment = {.u = still, .memory = &memory};
  geometry_t geometry;
  return impact(x, &segment, rebounds, &geometry);
}
EXPORTED int rank_found(double* W) { return rank_of(W); }
EXPORTED int stop_at(real* x, const double* direction) {
  memory_t memory = {0};
  segment_t segment = {.u = still, .memory = &memory};
  for (int i = 0; i < ND; ++i) segment.p.direction[i] = direction[i];
  return stop_joints(x, &segment);
}
EXPORTED void round_at(real* x) { stop_rounding(x); }
EXPORTED int held_at(const real* x, const real* u) {
  memory_t memory = {0};
  segment_t segment = {.u = u, .memory = &memory};
  for (int k = 0; k < NC; ++k) segment.contact[k].ended = STICKS;
  geometry_t geometry;
  find_geometry(x, &segment, &geometry);
  return solve_modes(x, &segment, &geometry) && is_held(x, &segment);
}
"""


@dataclass
class Answer:
    """Whether there is one, states (nc,), forces (nc, 3), directions of sliding (nc, 2)."""

    found: bool
    state: np.ndarray
    force: np.ndarray
    direction: np.ndarray


@cache
def _library(text: str) -> ctypes.CDLL:
    return compiler.build(_VISIBLE + text, local=INCLUDED).library


def solve_cones(
    W: np.ndarray,
    c: np.ndarray,
    mu: np.ndarray,
    given: list[np.ndarray | None] | None = None,
    allowed: np.ndarray | None = None,
) -> Answer:
    """Forces of several contacts; ``given`` are directions of those that slide already."""
    nc = len(mu)
    library = _library(f"#define NC {nc}\n" + _CONES)
    given = given or [None] * nc
    slides = np.array([d is not None for d in given], np.int32)
    directions = np.array([np.zeros(2) if d is None else d for d in given], float)
    may = np.ones(nc, np.int32) if allowed is None else np.array(allowed, np.int32)
    answer = Answer(False, np.zeros(nc, np.int32), np.zeros((nc, 3)), np.zeros((nc, 2)))
    arrays = (np.asfortranarray(W), c, np.array(mu, float), directions, slides, may)
    pointers = [_address(a) for a in (*arrays, answer.state, answer.force, answer.direction)]
    answer.found = bool(library.solve_cones(*pointers))
    return answer


def solve_cone(
    W: np.ndarray, c: np.ndarray, mu: float, given: np.ndarray | None = None
) -> tuple[int, np.ndarray]:
    """State and force of one contact, shape (3,)."""
    library, force = _library("#define NC 1\n" + _CONES), np.zeros(3)
    direction = None if given is None else _address(np.array(given, float))
    arrays = np.asfortranarray(W), np.array(c, float)
    state = library.solve_cone(
        *map(_address, arrays), ctypes.c_double(mu), direction, _address(force)
    )
    return state, force


@dataclass
class Located:
    """Where a value becomes positive, and how often it was computed for that."""

    at: float
    evaluations: int


def locate(
    functions: Callable[[float], float] | Sequence[Callable[[float], float]],
    h: float,
    nothing: float = 0.0,
) -> Located:
    """Where a function, or the first of some, becomes positive on (0, h], by the engine."""
    library, asked = _library(_SEARCH), list[float]()
    functions = [functions] if callable(functions) else functions

    def values_at(_: object, t: float, values: Any) -> None:
        asked.append(t)
        for i, f in enumerate(functions):
            values[i] = f(t)

    library.locate.restype = ctypes.c_double
    end = (ctypes.c_double * len(functions))(*(f(h) for f in functions))
    size, below = ctypes.c_double(h), ctypes.c_double(nothing)
    room = (ctypes.c_double * (4 * len(functions)))()
    at = library.locate(_CALLBACK(values_at), len(functions), size, end, below, room)
    return Located(float(at), len(asked))


def decay(x: np.ndarray, rate: float, h: float, control: SubstepControl) -> np.ndarray | None:
    """x' = -rate x over ``h`` by Heun's method under the engine's error control.

    The error of a sub-step is that of Euler's method. None if it gives up.
    """
    sizes = {"LARGEST": repr(LARGEST), "ADAPTIVE": 1, "ORDER": 2, "MOST_SUBSTEPS": 2000}
    library = _library("".join(f"#define {k} {v}\n" for k, v in sizes.items()) + _DECAY)
    u, after = np.array([rate]), np.zeros(2)
    done = library.decay(
        _address(x), _address(u), ctypes.c_double(h), ctypes.byref(control), _address(after)
    )
    return after if done else None


@dataclass
class Impulse:
    """Speeds of the points before, W, B, impulses, and the energy gained (inf if unsolvable)."""

    before: np.ndarray
    W: np.ndarray
    B: np.ndarray
    impulse: np.ndarray
    gain: float


class Engine:
    """The whole engine of a scene with contacts; nothing acts on its joints."""

    def __init__(self, scene: Any) -> None:
        plant = Plant(ArmModel(load_scene(scene)))
        choice = choose(plant, "rk4", None, None)
        functions, step = tick_functions(plant, choice, actuation(plant))
        driver = engine_source(plant, choice, functions, step) + _SCENE
        self._library = Kernel(functions, "native", driver, local=INCLUDED).library
        for name in ("impulse_at", "hit"):
            getattr(self._library, name).restype = ctypes.c_double
        self._sizes = plant.model.n, 3 * len(plant.points)

    def impulse(self, x: np.ndarray, rebound: np.ndarray) -> Impulse:
        """Impulses that give all points speeds of rebound of shape (nc,), as if all touched."""
        n, m = self._sizes
        W, B = np.zeros((m, m), order="F"), np.zeros((n, m), order="F")
        before, impulse = np.zeros(m), np.zeros(m)
        arrays = x, rebound, W, B, before, impulse
        gain = self._library.impulse_at(*map(_address, arrays))
        return Impulse(before, W, B, impulse, gain)

    def impact(self, x: np.ndarray, rebounds: bool = True) -> tuple[np.ndarray, float]:
        """State after the impacts of the points that touch and approach, and the energy lost."""
        after = x.copy()
        lost = self._library.hit(_address(after), int(rebounds))
        return after, lost

    def rank(self, W: np.ndarray) -> int:
        """Rank of a symmetric matrix of the size of the scene's contacts, shape (3 nc, 3 nc)."""
        return int(self._library.rank_found(_address(np.array(W, order="F"))))

    def stop(self, x: np.ndarray, direction: np.ndarray) -> np.ndarray | None:
        """State with joints at rest that moved in such directions and do not any more.

        None if one of them was too fast for that.
        """
        after = np.array(x, float)
        return after if self._library.stop_at(_address(after), _address(direction)) else None

    def rounded(self, x: np.ndarray) -> np.ndarray:
        """State with joints at rest that contacts keep there but for rounding."""
        after = np.array(x, float)
        self._library.round_at(_address(after))
        return after

    def is_held(self, x: np.ndarray, u: np.ndarray) -> bool:
        """Whether friction and contacts leave no joint any motion under the torque ``u``."""
        return bool(self._library.held_at(_address(x), _address(np.asarray(u, float))))


def _address(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)
