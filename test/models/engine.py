# SPDX-License-Identifier: Apache-2.0
"""The engine's C as it ships, piece by piece: the cone solver, the search for events, impacts.

Each is compiled from the files of ``stepping/native`` with a few exported lines behind them.
"""

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
from arm_sim.stepping.engine import INCLUDED, address_of
from arm_sim.stepping.scene_source import scene_source
from arm_sim.stepping.tick_functions import tick_functions

APART, SLIDES, STICKS, UNSOLVABLE = range(4)
_CALLBACK = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_double, ctypes.POINTER(ctypes.c_double)
)

_VISIBLE = '#include "scalar.h"\n#pragma GCC visibility push(default)\n'
_CONES = """
#include "contact/friction_cones.h"
int solve_cones(int nc, const double* W, const double* c, const double* mu, const double* given,
                const int* slides, const int* allowed, int* state, double* force,
                double* direction) {
  const scene_t sizes = {.nc = nc}, *scene = &sizes;
  LOCAL(cones_t, cones, cones_of, CONES);
  answer_t answers[NC + 1];
  cones.W = W;
  cones.c = c;
  cones.friction = cones.holding = mu;
  for (int k = 0; k < NC; ++k) {
    cones.slides[k] = slides[k];
    cones.allowed[k] = allowed[k];
    for (int i = 0; i < 2; ++i) cones.direction[2 * k + i] = given[2 * k + i];
  }
  const int found = solve_contacts(scene, &cones, answers);
  for (int k = 0; k < NC; ++k) {
    state[k] = answers[k].state;
    for (int i = 0; i < 3; ++i) force[3 * k + i] = answers[k].force[i];
    for (int i = 0; i < 2; ++i) direction[2 * k + i] = answers[k].direction[i];
  }
  return found;
}
int solve_cone(const double* W, const double* c, double mu, const double* given, double* force) {
  const scene_t sizes = {.nc = 1};
  double block[3][3];
  own_block(&sizes, W, 0, block);
  const answer_t answer = solve_contact(block, c, mu, mu, given);
  for (int i = 0; i < 3; ++i) force[i] = answer.force[i];
  return answer.state;
}
"""
_SEARCH = """
#include "guards/event_location.h"
double locate(void (*values_at)(const void*, double, double*), int count, double h,
              const double* at_h, double nothing, double* room) {
  return first_positive(values_at, 0, count, h, at_h, nothing, room);
}
"""
_DECAY = """
#include "motion/flow.h"
/* x' = -u x by Heun's method, its error that of Euler's; only the first number is a position. */
static int attempt(const real** arg, real** res, long long* iw, real* w, int mem) {
  const real *x = arg[0], u = arg[1][0], h = arg[3][0];
  double worst = 0.0;
  for (int i = 0; i < 2; ++i) {
    res[0][i] = x[i] * (1.0 - u * h + 0.5 * u * u * h * h);
    worst = fmax(worst, fabs(0.5 * u * u * h * h * x[i]));
  }
  *res[1] = worst, *res[2] = fabs(0.5 * u * u * h * h * x[0]);
  return 0;
}
int decay(const real* x, const real* u, double h, double largest, control_t* control,
          real* after) {
  const scene_t scene = {
    .nx = 2, .nu = 1, .sz_w = 1, .adaptive = 1, .order = 2,
    .most_substeps = 2000, .largest = largest, .attempt = attempt
  };
  return flow(&scene, 0, attempt, 0, x, u, 0, h, control, after);
}
"""
_SCENE = """
#include "arm/arm.c"
EXPORTED double hit(const scene_t* scene, real* x, int rebounds) {
  real still[NU];
  LOCAL_TICK(segment, still);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  clear(still, NU);
  return impact(scene, x, &segment, rebounds, &geometry);
}
EXPORTED int rank_found(const scene_t* scene, double* W) { return rank_of(scene, W); }
EXPORTED int stop_at(const scene_t* scene, real* x, const double* direction) {
  LOCAL_TICK(segment, 0);
  for (int i = 0; i < ND; ++i) segment.p.direction[i] = direction[i];
  return stop_joints(scene, x, &segment);
}
EXPORTED void round_at(const scene_t* scene, real* x) { stop_rounding(scene, x); }
EXPORTED void shares_at(const scene_t* scene, const real* x, const real* u, double* shares) {
  LOCAL_TICK(segment, u);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  LOCAL(loads_t, found, loads_of, LOADS);
  LOCAL(indeterminate_t, together, indeterminate_of, INDETERMINATE);
  find_geometry(scene, x, &segment, &geometry);
  guess_modes(scene, x, &segment, &geometry);
  find_loads(scene, x, &segment, &found);
  segment.yields = 1;
  find_sets_held(scene, x, &segment, &found, &together);
  copy(shares, together.amount, PARTS);
}
EXPORTED int held_at(const scene_t* scene, const real* x, const real* u) {
  LOCAL_TICK(segment, u);
  LOCAL(geometry_t, geometry, geometry_of, PLACES);
  find_geometry(scene, x, &segment, &geometry);
  return solve_modes(scene, x, &segment, &geometry) && is_held(scene, x, &segment);
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
    library = _library(_CONES)
    given = given or [None] * nc
    slides = np.array([d is not None for d in given], np.int32)
    directions = np.array([np.zeros(2) if d is None else d for d in given], float)
    may = np.ones(nc, np.int32) if allowed is None else np.array(allowed, np.int32)
    answer = Answer(False, np.zeros(nc, np.int32), np.zeros((nc, 3)), np.zeros((nc, 2)))
    arrays = (np.asfortranarray(W), c, np.array(mu, float), directions, slides, may)
    pointers = [_address(a) for a in (*arrays, answer.state, answer.force, answer.direction)]
    answer.found = bool(library.solve_cones(nc, *pointers))
    return answer


def solve_cone(
    W: np.ndarray, c: np.ndarray, mu: float, given: np.ndarray | None = None
) -> tuple[int, np.ndarray]:
    """State and force of one contact, shape (3,)."""
    library, force = _library(_CONES), np.zeros(3)
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
    library = _library(_DECAY)
    u, after = np.array([rate]), np.zeros(2)
    done = library.decay(
        _address(x), _address(u), ctypes.c_double(h), ctypes.c_double(LARGEST),
        ctypes.byref(control), _address(after),
    )  # fmt: skip
    return after if done else None


class Engine:
    """The whole engine of a scene with contacts; nothing acts on its joints."""

    def __init__(self, scene: Any) -> None:
        plant = Plant(ArmModel(load_scene(scene)))
        choice = choose(plant, "rk4", None, None)
        functions, step = tick_functions(plant, choice, actuation(plant))
        driver = scene_source(plant, choice, functions, step)
        self._own = Kernel(functions, "native", driver, local=INCLUDED).library
        self._scene = ctypes.c_void_p(address_of(self._own))
        self._library = _library(_SCENE)
        self._library.hit.restype = ctypes.c_double
        self._sizes = plant.model.n, 3 * len(plant.points)

    def impact(self, x: np.ndarray, rebounds: bool = True) -> tuple[np.ndarray, float]:
        """State after the impacts of the points that touch and approach, and the energy lost."""
        after = x.copy()
        lost = self._library.hit(self._scene, _address(after), int(rebounds))
        return after, lost

    def rank(self, W: np.ndarray) -> int:
        """Rank of a symmetric matrix of the size of the scene's contacts, shape (3 nc, 3 nc)."""
        return int(self._library.rank_found(self._scene, _address(np.array(W, order="F"))))

    def stop(self, x: np.ndarray, direction: np.ndarray) -> np.ndarray | None:
        """State with joints at rest that moved in such directions and do not any more.

        None if one of them was too fast for that.
        """
        after = np.array(x, float)
        stops = self._library.stop_at(self._scene, _address(after), _address(direction))
        return after if stops else None

    def rounded(self, x: np.ndarray) -> np.ndarray:
        """State with joints at rest that contacts keep there but for rounding."""
        after = np.array(x, float)
        self._library.round_at(self._scene, _address(after))
        return after

    def shares(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Of joints and contacts in the motion in which what holds together gives way."""
        n, m = self._sizes
        found = np.zeros(n + m // 3)
        torque = np.asarray(u, float)
        self._library.shares_at(self._scene, _address(x), _address(torque), _address(found))
        return found

    def is_held(self, x: np.ndarray, u: np.ndarray) -> bool:
        """Whether friction and contacts leave no joint any motion under the torque ``u``."""
        return bool(
            self._library.held_at(self._scene, _address(x), _address(np.asarray(u, float)))
        )


def _address(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)
