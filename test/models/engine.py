# SPDX-License-Identifier: Apache-2.0
"""The engine's C as it ships, piece by piece: the cone solver, the search for events, sub-steps.

Each is compiled from the files of ``stepping/native`` with a few exported lines behind them.
"""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from arm_dynamics.codegen import compiler
from arm_sim.stepping.adaptive import LARGEST, SubstepControl
from arm_sim.stepping.engine import INCLUDED

APART, SLIDES, STICKS, UNSOLVABLE = range(4)
_CALLBACK = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_double, ctypes.POINTER(ctypes.c_double)
)

_VISIBLE = '#include "scalar.h"\n#pragma GCC visibility push(default)\n'
_CONES = """
#include "contact/several_contacts.h"
int solve_cones(int nc, const double* W, const double* c, const double* mu, int* state,
                double* force, double* direction) {
  const scene_t sizes = {.nc = nc}, *scene = &sizes;
  LOCAL(cones_t, cones, cones_of, CONES);
  contact_solution_t answers[NC + 1];
  cones.W = W;
  cones.c = c;
  cones.friction = cones.static_friction = mu;
  for (int k = 0; k < NC; ++k) {
    cones.was_sliding[k] = 0;
    cones.is_touching[k] = 1;
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
  const contact_solution_t answer = solve_contact(block, c, mu, mu, given);
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
    .substep_limit = 2000, .largest = largest, .attempt = attempt
  };
  return flow(&scene, 0, attempt, 0, x, u, 0, h, control, after);
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


def solve_cones(W: np.ndarray, c: np.ndarray, mu: np.ndarray) -> Answer:
    """Forces of several contacts."""
    nc, library = len(mu), _library(_CONES)
    answer = Answer(False, np.zeros(nc, np.int32), np.zeros((nc, 3)), np.zeros((nc, 2)))
    arrays = np.asfortranarray(W), c, np.array(mu, float)
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


def _address(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)
