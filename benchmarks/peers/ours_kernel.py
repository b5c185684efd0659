# SPDX-License-Identifier: Apache-2.0
"""The generated forward dynamics alone, called in a loop from C, and the rollouts."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.codegen.kernel import Kernel
from arm_sim import Simulator
from arm_sim.plant.plant import Plant
from benchmarks.measure import Job, cpu
from benchmarks.robots import Robot

CALLS = 20_000
# The position moves a little with every call: no compiler can lift the work out of the loop.
LOOP = """
__attribute__((visibility("default")))
void evaluate(double* q, const double* v, const double* tau, double* out, long long calls) {
  double w[%(w)d], p[1] = {0};
  casadi_int iw[%(iw)d];
  const double* arg[%(arg)d];
  double* res[%(res)d];
  for (long long k = 0; k < calls; ++k) {
    q[0] += 1e-9;
    arg[0] = q; arg[1] = v; arg[2] = tau; arg[3] = p;
    res[0] = out;
    acceleration(arg, res, iw, w, 0);
  }
}
"""


def evaluation(robot: Robot) -> Job:
    """Seconds for one generated forward dynamics, called from C."""
    f = Plant(ArmModel(load_scene(robot.urdf))).acceleration
    sizes = {"w": f.sz_w() + 8, "iw": f.sz_iw() + 8, "arg": f.sz_arg() + 8, "res": f.sz_res() + 8}
    library = Kernel([f], "native", LOOP % sizes).library
    assert library is not None, "the backend is native"
    q, v, tau = np.random.default_rng(0).uniform(-1, 1, (3, robot.n))
    out = np.zeros(robot.n)
    addresses = [ctypes.c_void_p(x.ctypes.data) for x in (q, v, tau, out)]
    kept = (q, v, tau, out)

    def calls(_: object = kept) -> None:
        library.evaluate(*addresses, ctypes.c_longlong(CALLS))

    return lambda: cpu(calls) / CALLS


def fleet(
    method: str, step: float, steps: int, lanes: int | None = None
) -> Callable[[Robot, int], Callable[..., object]]:
    """A maker of fleets with one integrator: ``Simulator.rollout`` on a number of threads.

    Args:
        method: integrator.
        step: its length [s].
        steps: how many in a call.
        lanes: doubles in a vector, None for the widest that the processor has.
    """

    def build(robot: Robot, threads: int) -> Callable[..., object]:
        simulator = Simulator(robot.urdf, integrator=method, dt=step)

        def roll(q0: np.ndarray, v0: np.ndarray, tau: np.ndarray) -> np.ndarray:
            return simulator.rollout(q0, v0, tau, steps, threads=threads, lanes=lanes)

        return roll

    return build
