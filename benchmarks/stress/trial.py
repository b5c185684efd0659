# SPDX-License-Identifier: Apache-2.0
"""One tree, one method, one step size: what became of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from arm_dynamics import ArmError, ArmModel, load_scene
from arm_sim import SimulationDiverged, Simulator
from benchmarks.stress.trees import Tree

TICKS = 200
TRUTH_TOLERANCES = (1e-10, 1e-12)
KNOWN = 1e-5  # uncertainty of the truth, beyond which the motion is chaos and has no known end
FASTER = 10.0  # times the true motion's top speed: the method has blown up
BALANCE = 0.1  # of the energies at work: an energy balance that nobody can overlook
SOUND, SHOWN, RAISED, REFUSED = "sound", "wrong, balance shows it", "raised", "refused"
UNDETECTED, NAN = "undetected blow-up", "silent NaN"
OUTCOMES = (SOUND, SHOWN, RAISED, REFUSED, UNDETECTED, NAN)
FORBIDDEN = (UNDETECTED, NAN)


@dataclass(frozen=True)
class Truth:
    """An error-controlled run to compare with.

    Attributes:
        q: positions at the end, shape (n,).
        top_speed: largest |v| of the motion.
        uncertainty: change of the end, relative to 1 + |q|, with a hundredfold tolerance.
    """

    q: np.ndarray
    top_speed: float
    uncertainty: float


@dataclass(frozen=True)
class Result:
    """What became of one run.

    Attributes:
        seed: of the tree.
        method: integrator, with its tolerance if it has one.
        dt: length of a tick [s].
        outcome: one of ``OUTCOMES``.
        error: largest error of q at the end, relative to 1 + |q|; None where the end is unknown.
        balance: largest energy that came from nowhere, relative to the energies at work.
        message: what was said when it was refused or raised.
    """

    seed: int
    method: str
    dt: float
    outcome: str
    error: float | None = None
    balance: float | None = None
    message: str = ""


class Subject:
    """A tree, its model and the torque that is held."""

    def __init__(self, tree: Tree, backend: str) -> None:
        """Build the model; raises ``ArmError`` if the tree is refused."""
        self.tree, self.backend = tree, backend
        self.model = ArmModel(load_scene(tree.urdf))
        first = Simulator(self.model, integrator="euler", dt=1e-3, backend=backend)
        weight = first.dynamics.gravity(tree.q)
        signs = np.sign(np.random.default_rng(tree.seed).uniform(-1, 1, tree.n))
        # A joint that carries no weight is not left without torque.
        self.tau = tree.push * signs * np.maximum(np.abs(weight), 0.01 * np.abs(weight).max())

    def truth(self, dt: float) -> Truth | None:
        """The motion over ``TICKS`` ticks of ``dt``, or None if it cannot be computed."""
        try:
            rough, fine = (self._run("dop853", dt, t) for t in TRUTH_TOLERANCES)
        except ArmError:
            return None
        uncertainty = float(np.max(np.abs(rough.q[-1] - fine.q[-1]) / (1 + np.abs(fine.q[-1]))))
        return Truth(fine.q[-1], float(np.abs(fine.v).max()), uncertainty)

    def attempt(
        self, method: str, dt: float, tolerance: float | None, truth: Truth | None
    ) -> Result:
        """Run one method and judge it."""
        label = method if tolerance is None else f"{method}, tolerance {tolerance:g}"
        tell = partial(Result, self.tree.seed, label, dt)
        try:
            run = self._run(method, dt, tolerance)
        except SimulationDiverged as error:
            finite = error.recording is None or _finite(error.recording)
            return tell(RAISED if finite else NAN, message=str(error))
        except ArmError as error:
            return tell(REFUSED, message=str(error))
        if not _finite(run):
            return tell(NAN)
        balance = _balance(run)
        return tell(_judge(run, balance, truth), _error(run, truth), balance)

    def _run(self, method: str, dt: float, tolerance: float | None) -> Any:
        simulator = Simulator(self.model, integrator=method, dt=dt, tolerance=tolerance,
                              backend=self.backend)  # fmt: skip
        simulator.reset(self.tree.q, self.tree.v)
        return simulator.run(TICKS * dt, self.tau)


def _finite(run: Any) -> bool:
    return bool(np.isfinite(run.q).all() and np.isfinite(run.v).all())


def _balance(run: Any) -> float:
    """Energy from nowhere, relative to what moves about: kinetic energy, work, lifted weight."""
    work = np.abs(np.sum(run.tau[:-1] * np.diff(run.q, axis=0), axis=1)).sum()
    size = run.kinetic.max() + work + np.ptp(run.potential) + 1e-12
    with np.errstate(over="ignore", invalid="ignore"):
        value = float(np.abs(run.balance).max() / size)
    return value if np.isfinite(value) else np.inf


def _judge(run: Any, balance: float, truth: Truth | None) -> str:
    if balance >= BALANCE:
        return SHOWN
    if truth is None:
        return SOUND
    too_fast = np.abs(run.v).max() > FASTER * max(truth.top_speed, 1e-3)
    return UNDETECTED if too_fast else SOUND


def _error(run: Any, truth: Truth | None) -> float | None:
    if truth is None or truth.uncertainty > KNOWN:
        return None
    return float(np.max(np.abs(run.q[-1] - truth.q) / (1 + np.abs(truth.q))))
