# SPDX-License-Identifier: Apache-2.0
"""One arm, one method, one step: what became of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from arm_dynamics import ArmError, ArmModel
from arm_sim import Recording, SimulationDiverged, Simulator
from benchmarks.stress.arms import Arm
from benchmarks.stress.balances import energy_balance, impulse_balance
from benchmarks.stress.motion import GRID, Motion, difference

ENERGY = 0.05  # energy from nowhere, of what is exchanged, that nobody can overlook
IMPULSE = 0.4  # speed from nowhere, of a joint's top speed, likewise
FASTER = 3.0  # a joint so many times faster than in the true motion has blown up
RICHER = 2.0  # as has an arm with so many times its kinetic energy
CHAOS = 10.0  # times that is allowed where the true motion is one of many
RIGHT = 0.01  # of the way: a motion that is no further from where it should be is right

SURVIVED, SHOWN, STOPPED, REFUSED = "survived", "shown", "stopped", "refused"
UNDETECTED, NAN = "undetected", "silent NaN"
OUTCOMES = (SURVIVED, SHOWN, STOPPED, REFUSED, UNDETECTED, NAN)
FORBIDDEN = (UNDETECTED, NAN)


@dataclass(frozen=True)
class Setting:
    """A way to integrate.

    Attributes:
        method: integrator.
        dt: length of a tick [s].
        tolerance: of error control; None for one step a tick.
    """

    method: str
    dt: float
    tolerance: float | None = None

    @property
    def name(self) -> str:
        """Method and tolerance."""
        return self.method if self.tolerance is None else f"{self.method} {self.tolerance:g}"


@dataclass(frozen=True)
class Result:
    """What became of one run.

    Attributes:
        seed: of the arm.
        name: method, with its tolerance if it has one.
        dt: length of a tick [s].
        outcome: one of ``OUTCOMES``.
        error: largest error of q, relative to 1 + |q|; None where the motion is not known.
        energy: energy from nowhere, relative to what is exchanged.
        impulse: speed from nowhere, relative to a joint's top speed; None with error control,
            whose steps the recording does not show, and with dry friction.
        claimed: error that the simulator itself estimates [rad] or [m]; None with fixed steps.
        speed: top speed of a joint, relative to the true one.
        false_alarm: whether a balance cries wolf: the motion is right.
        message: what was said when it stopped or was refused.
    """

    seed: int
    name: str
    dt: float
    outcome: str
    error: float | None = None
    energy: float | None = None
    impulse: float | None = None
    claimed: float | None = None
    speed: float | None = None
    false_alarm: bool = False
    message: str = ""


def attempt(
    arm: Arm, model: ArmModel, motion: Motion, setting: Setting, backend: str = "auto"
) -> Result:
    """Run an arm once and judge what comes of it.

    Args:
        arm: the arm.
        model: of it.
        motion: what it really does.
        setting: how to integrate.
        backend: of the simulator.
    """
    told = Result(arm.seed, setting.name, setting.dt, REFUSED)
    try:
        simulator = Simulator(model, setting.method, setting.dt, setting.tolerance, backend)
        simulator.reset(arm.q, arm.v)
        run = simulator.run(motion.horizon, arm.tau)
    except SimulationDiverged as error:
        kept = error.recording is not None and _finite(error.recording, simulator)
        return replace(told, outcome=STOPPED if kept else NAN, message=str(error))
    except ArmError as error:
        return replace(told, message=str(error))
    if not _finite(run, simulator):
        return replace(told, outcome=NAN)
    return _judged(replace(told, outcome=SURVIVED), arm, motion, setting, run)


def _finite(run: Recording, simulator: Simulator) -> bool:
    state = simulator.state
    arrays = (run.q, run.v, run.tau, run.local_error, state.q, state.v, simulator.effort)
    return all(bool(np.isfinite(array).all()) for array in arrays)


def _judged(told: Result, arm: Arm, motion: Motion, setting: Setting, run: Recording) -> Result:
    fixed = setting.tolerance is None
    found = replace(
        told,
        error=_error(run, motion, setting.dt),
        energy=energy_balance(run),
        impulse=impulse_balance(run) if fixed else None,
        claimed=None if fixed else float(run.local_error[-1]),
        speed=_speed(run, motion),
    )
    if found.energy > ENERGY or (found.impulse or 0.0) > IMPULSE:
        right = found.error is not None and found.error <= RIGHT * motion.travel
        return replace(found, outcome=SURVIVED if right else SHOWN, false_alarm=right)
    return replace(found, outcome=UNDETECTED) if _blown_up(found, run, motion) else found


def _blown_up(found: Result, run: Recording, motion: Motion) -> bool:
    """Whether it is far from the true motion: faster, richer, or further than that ever goes."""
    if motion.q is None or found.speed is None:
        return False
    margin = 1.0 if motion.steady else CHAOS
    fast = found.speed > margin * FASTER
    rich = run.kinetic.max() > margin * RICHER * motion.kinetic
    astray = motion.steady and found.error is not None and found.error > motion.travel
    return bool(fast or rich or astray)


def _error(run: Recording, motion: Motion, dt: float) -> float | None:
    if motion.q is None or not motion.known:
        return None
    return difference(run.q[:: round(GRID / dt)], motion.q)


def _speed(run: Recording, motion: Motion) -> float | None:
    if motion.speed is None:
        return None
    least = 1e-2 * motion.speed.max() + np.finfo(float).tiny
    return float(np.max(np.abs(run.v).max(axis=0) / np.maximum(motion.speed, least)))
