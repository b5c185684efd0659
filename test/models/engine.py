# SPDX-License-Identifier: Apache-2.0
"""The engine's C as it ships, piece by piece: the cone solver, the search for events, impacts.

Each is compiled from the files of ``stepping/native`` with a few exported lines behind them.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.kernel import Kernel
from arm_sim import Simulator
from arm_sim.integrators.methods import build_step
from arm_sim.plant.actuation import actuation
from arm_sim.stepping.stepper import engine_source, source

APART, SLIDES, STICKS, UNSOLVABLE = range(4)
_CALLBACK = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_double)

_CONES = """
__attribute__((visibility("default")))
int solve_cones(const double* W, const double* c, const double* mu, const double* given,
                const int* slides, const int* allowed, int* state, double* force) {
  cones_t cones = {.W = W, .c = c, .friction = mu};
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
  }
  return found;
}
__attribute__((visibility("default")))
int solve_cone(const double* W, const double* c, double mu, const double* given, double* force) {
  double block[3][3];
  own_block(W, 0, block);
  const answer_t answer = single(block, c, mu, given);
  for (int i = 0; i < 3; ++i) force[i] = answer.force[i];
  return answer.state;
}
"""
_SEARCH = """
__attribute__((visibility("default")))
double locate(double (*value_at)(const void*, double), double h) {
  return first_positive(value_at, 0, h, value_at(0, h));
}
"""
_IMPACT = """
__attribute__((visibility("default")))
double impulse_at(const double* x, const double* rebound, double* W, double* B, double* before,
                  double* impulse) {
  static const real still[NU];
  geometry_t geometry;
  inertia_t inertia;
  segment_t segment = {.u = still};
  for (int k = 0; k < NC; ++k) segment.contact[k].touching = 1;
  find_geometry(x, &geometry);
  find_inertia(x, &segment, &inertia);
  for (int i = 0; i < MC; ++i) before[i] = geometry.speed[i];
  for (int i = 0; i < MC * MC; ++i) W[i] = inertia.W[i];
  for (int i = 0; i < NU * MC; ++i) B[i] = inertia.B[i];
  return find_impulse(&inertia, before, rebound, 1.0, segment.contact, impulse);
}
"""


@dataclass
class Answer:
    """Whether an answer was found, states of shape (nc,) and forces of shape (nc, 3)."""

    found: bool
    state: np.ndarray
    force: np.ndarray


@cache
def _library(text: str) -> ctypes.CDLL:
    return compiler.build('#include "scalar.h"\n' + text).library


def solve_cones(
    W: np.ndarray,
    c: np.ndarray,
    mu: np.ndarray,
    given: list[np.ndarray | None] | None = None,
    allowed: np.ndarray | None = None,
) -> Answer:
    """Forces of several contacts; ``given`` are directions of those that slide already."""
    nc = len(mu)
    library = _library(source({"NC": str(nc)}, "cone.c") + _CONES)
    given = given or [None] * nc
    slides = np.array([d is not None for d in given], np.int32)
    directions = np.array([np.zeros(2) if d is None else d for d in given], float)
    may = np.ones(nc, np.int32) if allowed is None else np.array(allowed, np.int32)
    answer = Answer(False, np.zeros(nc, np.int32), np.zeros((nc, 3)))
    arrays = (np.asfortranarray(W), c, np.array(mu, float), directions, slides, may)
    pointers = [_address(a) for a in (*arrays, answer.state, answer.force)]
    answer.found = bool(library.solve_cones(*pointers))
    return answer


def solve_cone(
    W: np.ndarray, c: np.ndarray, mu: float, given: np.ndarray | None = None
) -> tuple[int, np.ndarray]:
    """State and force of one contact, shape (3,)."""
    library, force = _library(source({"NC": "1"}, "cone.c") + _CONES), np.zeros(3)
    direction = None if given is None else _address(np.array(given, float))
    arrays = np.asfortranarray(W), np.array(c, float)
    state = library.solve_cone(
        *map(_address, arrays), ctypes.c_double(mu), direction, _address(force)
    )
    return state, force


def locate(f: Callable[[float], float], h: float) -> float:
    """Where ``f`` becomes positive on (0, h], by the engine's search."""
    library = _library(source({}, "search.c") + _SEARCH)
    library.locate.restype = ctypes.c_double
    return float(library.locate(_CALLBACK(lambda _, t: f(t)), ctypes.c_double(h)))


@dataclass
class Impulse:
    """Speeds of the points before, W, B, impulses, and the energy gained (inf if unsolvable)."""

    before: np.ndarray
    W: np.ndarray
    B: np.ndarray
    impulse: np.ndarray
    gain: float


class Impacts:
    """Impulses of a scene with contacts at any state, all of whose points touch."""

    def __init__(self, sim: Simulator) -> None:
        plant, choice = sim.plant, sim.choice
        step = build_step(choice.method, plant.rhs, plant.model.n)
        functions = [plant.rhs, step, actuation(plant), *plant.events]
        driver = engine_source(plant, choice, functions) + _IMPACT
        self._library = Kernel(functions, "native", driver).library
        self._library.impulse_at.restype = ctypes.c_double
        self._sizes = plant.model.n, 3 * len(plant.points)

    def __call__(self, x: np.ndarray, rebound: np.ndarray) -> Impulse:
        """Impulses that give the points speeds of rebound of shape (nc,)."""
        n, m = self._sizes
        W, B = np.zeros((m, m), order="F"), np.zeros((n, m), order="F")
        before, impulse = np.zeros(m), np.zeros(m)
        arrays = x, rebound, W, B, before, impulse
        gain = self._library.impulse_at(*map(_address, arrays))
        return Impulse(before, W, B, impulse, gain)


def _address(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)
