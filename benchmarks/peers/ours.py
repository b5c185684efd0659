# SPDX-License-Identifier: Apache-2.0
"""This suite, reached the way its users reach it: ``Simulator.run`` and ``Simulator.rollout``.

And its generated forward dynamics alone, called in a loop from C.
"""

import ctypes
from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.codegen.compiler import compiler_version, find_compiler
from arm_dynamics.codegen.kernel import Kernel
from arm_sim import SimulationDiverged, Simulator
from arm_sim.integrators.methods import METHODS
from arm_sim.plant.plant import Plant
from benchmarks.measurement.timing import Job, cpu
from benchmarks.peers.base import OURS, TICK, Contestant, Vector, decades, halvings
from benchmarks.robots.models import Robot

STEPS = {
    "euler": (halvings(8e-3, 1.5e-5), halvings(TICK, 1.5e-5)),
    "semi_implicit_euler": (halvings(8e-3, 1.5e-5), halvings(TICK, 1.5e-5)),
    "midpoint": (halvings(8e-3, 3e-5), halvings(TICK, 6e-5)),
    "heun": (halvings(8e-3, 3e-5), halvings(TICK, 6e-5)),
    "rk4": (halvings(8e-3, 6e-5), halvings(TICK, 2.5e-4)),
    "nystrom4": (halvings(8e-3, 6e-5), halvings(TICK, 2.5e-4)),
    "dopri5": (halvings(20e-3, 3e-4), halvings(TICK, 5e-4)),
    "dop853": (halvings(40e-3, 1.25e-3), halvings(TICK, 5e-4)),
}
OTHER_STEPS = (halvings(8e-3, 2.5e-4), halvings(TICK, 2.5e-4))
TOLERANCES = (decades(-3, -13), (1e-4, 1e-7))
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


def contestants() -> list[Contestant]:
    """Every integrator with fixed steps, and all that estimate their error with control."""
    fixed = [
        Contestant(OURS, name, "step", *STEPS.get(name, OTHER_STEPS), partial(FixedTrial, name))
        for name in METHODS
    ]
    controlled = [
        Contestant(OURS, f"{name}, adaptive", "tolerance", *TOLERANCES,
                   partial(AdaptiveTrial, name))
        for name, method in METHODS.items()
        if method.adaptive
    ]  # fmt: skip
    return fixed + controlled


def backend() -> str:
    command = find_compiler()
    return compiler_version(command) if command else "none: CasADi's virtual machine"


class FixedTrial:
    """One step of the method a tick; smaller steps repeat the rows of a torque table."""

    def __init__(self, method: str, robot: Robot, step: float) -> None:
        self.substeps = round(TICK / step)
        self.simulator = Simulator(_model(robot.urdf), integrator=method, dt=step)
        self.lost = False

    def reset(self, q: Vector, v: Vector) -> None:
        self.lost = False
        self.simulator.reset(q, v)

    def advance(self, duration: float) -> None:
        self._run(duration, None)

    def replay(self, torques: Vector) -> None:
        table = np.repeat(torques, self.substeps, axis=0) if self.substeps > 1 else torques
        self._run(len(torques) * TICK, table)

    def state(self) -> tuple[Vector, Vector]:
        state = self.simulator.state
        wrong = np.nan if self.lost else 0.0
        return state.q + wrong, state.v + wrong

    def acceleration(self, q: Vector, v: Vector, tau: Vector) -> Vector:
        return _acceleration(self.simulator.model, q, v, tau)

    def _run(self, duration: float, control: Vector | None) -> None:
        try:
            self.simulator.run(duration, control)
        except SimulationDiverged:
            self.lost = True


class AdaptiveTrial:
    """Error-controlled sub-steps: ticks of 1 s in free motion, of 1 ms under held torques."""

    def __init__(self, method: str, robot: Robot, tolerance: float) -> None:
        build = partial(Simulator, _model(robot.urdf), integrator=method, tolerance=tolerance)
        self.free, self.held = build(dt=1.0), build(dt=TICK)
        self.used = self.free

    def reset(self, q: Vector, v: Vector) -> None:
        self.free.reset(q, v)
        self.held.reset(q, v)

    def advance(self, duration: float) -> None:
        self.used = self.free
        self.free.run(duration)

    def replay(self, torques: Vector) -> None:
        self.used = self.held
        self.held.run(len(torques) * TICK, torques)

    def state(self) -> tuple[Vector, Vector]:
        return self.used.state.q.copy(), self.used.state.v.copy()

    def acceleration(self, q: Vector, v: Vector, tau: Vector) -> Vector:
        return _acceleration(self.free.model, q, v, tau)


def evaluation(robot: Robot) -> Job:
    """Seconds for one generated forward dynamics, called from C."""
    f = Plant(_model(robot.urdf)).mechanics.acceleration
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
) -> Callable[[Robot], Callable[..., object]]:
    """A maker of fleets with one integrator: ``Simulator.rollout`` on one core."""

    def build(robot: Robot) -> Callable[..., object]:
        simulator = Simulator(robot.urdf, integrator=method, dt=step)
        return lambda q0, v0, tau: simulator.rollout(q0, v0, tau, steps, threads=1, lanes=lanes)

    return build


@lru_cache
def _model(urdf: str) -> ArmModel:
    return ArmModel(load_scene(urdf))


@lru_cache(maxsize=1)
def _euler(model: ArmModel) -> Simulator:
    return Simulator(model, integrator="euler", dt=TICK)


def _acceleration(model: ArmModel, q: Vector, v: Vector, tau: Vector) -> Vector:
    """What the generated code computes: one explicit Euler step is v + h a."""
    euler = _euler(model)
    euler.reset(q, v)
    return (euler.step(tau).v - v) / TICK
