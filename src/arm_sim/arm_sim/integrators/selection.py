# SPDX-License-Identifier: Apache-2.0
"""Selection of the integration method of a scene."""

from __future__ import annotations

import logging

import numpy as np

from arm_dynamics import ArmModel, Dynamics, InvalidInput
from arm_dynamics.actuation.joint_laws import friction_laws
from arm_dynamics.arrays import real_number
from arm_dynamics.attributes import frozen
from arm_dynamics.exceptions import choices
from arm_sim.integrators.linear_response import SPRINGS, STOPS, LinearResponse, responses
from arm_sim.integrators.methods import METHODS, Method
from arm_sim.integrators.stability import fastest_growing_mode, is_unstable, longest_step
from arm_sim.plant.plant import Plant

DT_RANGE = (1e-9, 10.0)  # [s] that a tick may last
LONG_TICK = 0.1  # [s]
TOLERANCE_RANGE = (1e-14, 1e-1)  # from rounding to what is no accuracy
# Explicit methods of order 4 are stable up to h λ = 2.8 (Hairer, Wanner, Solving Ordinary
# Differential Equations II, figure IV.2.1). Half of that is allowed where the arm begins; it is
# faster in other postures, of which only some are looked at.
STIFFNESS, SAMPLE_STIFFNESS = 1.4, 2.5
# Tolerance of a sub-step, relative to the scene's accuracy: a second takes a thousand sub-steps
# and more, whose errors add up; those of the implicit method, which damps what is stiff, less so.
SHARE, SHARE_IMPLICIT = 1e-4, 1e-2
# Drives, springs and compliant stops respond within a tick, so a step of fixed length cannot be
# trusted: see docs/concepts/drives.md for the cost of these tolerances. From about this rate, the
# extrapolated implicit method is faster than DOP853.
IMPLICIT_STIFFNESS = 50.0
# A swing of h ω in a step is computed by RK4 with an error of (h ω)⁴/120 radians per radian.
SWING = 0.05
# Falling friction lets a joint speed up at a rate λ, until it has passed the Stribeck velocity;
# RK4 leaves that with an error of (h λ)⁵/120 of it.
STRIBECK_RATE = 0.3
INACCURACY = "a second of motion by steps of fixed length misses the accuracy"
_log = logging.getLogger(__name__)


@frozen
class Choice:
    """Integration method and parameters of a scene.

    Attributes:
        method: The method.
        dt: Length of a tick in [s].
        tolerance: Scaled error per sub-step, None for one step of fixed length per tick.
        reason: Why this method was selected, as text.
        instead: What to take if the steps of fixed length turn out to miss the scene's accuracy.
    """

    method: Method
    dt: float
    tolerance: float | None
    reason: str
    instead: Choice | None = None

    @property
    def remark(self) -> str:
        """Advice for a tick that cannot be computed."""
        if self.tolerance is None:
            return f" at dt = {self.dt:g} s (a smaller dt or a tolerance may help)"
        return f" to a tolerance of {self.tolerance:g} (a larger one may help)"


def choose(
    plant: Plant, integrator: str | None, dt: float | None, tolerance: float | None
) -> Choice:
    """Select method, tick and tolerance: the caller's, else the scene's, else the default.

    A method that the caller names does without the scene's tolerance.

    Args:
        plant: The scene's equation of motion.
        integrator: Name of a method, ``auto`` or None.
        dt: Length of a tick in [s] or None.
        tolerance: Scaled error per sub-step or None.

    Returns:
        The choice.

    Raises:
        InvalidInput: If one of them is not allowed or they cannot be combined.
    """
    sim = plant.model.scene.sim
    name = integrator or sim.integrator or "auto"
    if tolerance is None and integrator is None:  # a scene's tolerance is for its own method
        tolerance = sim.tolerance
    dt = _check_tick(sim.dt if dt is None else dt)
    if tolerance is not None:
        tolerance = _check_within("tolerance", tolerance, TOLERANCE_RANGE, "")
    if name not in ("auto", *METHODS):
        raise InvalidInput(f"integrator = {name!r}; allowed: {choices(name, ('auto', *METHODS))}")
    rate, law = law_rate(plant.model)
    if rate * dt > STIFFNESS and (name == "auto" or tolerance is None):
        reason = f"{law} answers in {1 / rate:.2g} s: implicit, with error control"
        if name not in ("auto", "implicit"):
            _log.warning("integrator = %r is replaced at dt = %g s: %s", name, dt, reason)
        share = SHARE if _has_swings(responses(plant), dt) else SHARE_IMPLICIT
        return _implicit(plant, dt, tolerance, reason, share)
    if name == "auto":
        return _choose_automatically(plant, dt, tolerance)
    return _choose_by_name(plant, METHODS[name], dt, tolerance)


def _check_tick(dt: float) -> float:
    """Check the length of a tick in [s]."""
    dt = _check_within("dt", dt, DT_RANGE, " s")
    if dt > LONG_TICK:
        _log.warning(
            "dt = %g s is long for a time step: a torque is held for all of it, and without a "
            "tolerance it is one step; arms are controlled every 0.001 to 0.01 s", dt,
        )  # fmt: skip
    return dt


def _choose_by_name(plant: Plant, method: Method, dt: float, tolerance: float | None) -> Choice:
    """The choice of a method by its name."""
    name = method.name
    if tolerance is not None and not method.adaptive:
        able = ", ".join(m.name for m in METHODS.values() if m.adaptive)
        raise InvalidInput(
            f"integrator = {name!r} has no error estimate; with a tolerance: auto, {able}"
        )
    danger = "" if tolerance is not None else _instability(plant, method, dt)
    if danger:
        _log.warning("integrator = %r is %s", name, danger)
    return Choice(method, dt, tolerance, f"asked for, but {danger}" if danger else "asked for")


def _choose_automatically(plant: Plant, dt: float, tolerance: float | None) -> Choice:
    """The method of a scene that names none: by its stiffness, and by what varies in it."""
    samples = responses(plant)
    if plant.nz or _has_swings(samples, dt):
        return _with_error_control(plant, dt, tolerance, samples)
    if cause := _variation(plant, dt):
        return _with_error_control(plant, dt, tolerance, samples, cause)
    if any(r.fastest_rate * dt > (STIFFNESS if r.initial else SAMPLE_STIFFNESS) for r in samples):
        if any(plant.model.friction.tables):  # slopes at the start say little about others
            return _with_error_control(plant, dt, tolerance, samples)
        stiff = f"stiff: {_fastest_mode(plant, samples)}"
        instead = _implicit(plant, dt, None, f"{stiff}; {INACCURACY}")
        return Choice(METHODS["implicit"], dt, tolerance, stiff, instead)
    if tolerance is None:
        instead = _with_error_control(plant, dt, None, samples, INACCURACY)
        return Choice(METHODS["rk4"], dt, None, "the scene is not stiff", instead)
    return Choice(METHODS["dop853"], dt, tolerance, "not stiff, error control: the highest order")


def _with_error_control(
    plant: Plant, dt: float, tolerance: float | None, samples: list[LinearResponse],
    cause: str = "",
) -> Choice:  # fmt: skip
    """A method with error control."""
    if any(response.fastest_rate * dt > IMPLICIT_STIFFNESS for response in samples):
        reason = f"stiff, error control: {_fastest_mode(plant, samples)}"
        return _implicit(plant, dt, tolerance, reason)
    cause = cause or ("drives with internal states" if plant.nz else _fastest_mode(plant, samples))
    reason = f"{cause}: error control, the highest order"
    tolerance = tolerance or _substep_tolerance(plant, SHARE)
    return Choice(METHODS["dop853"], dt, tolerance, reason)


def _implicit(
    plant: Plant, dt: float, tolerance: float | None, reason: str, share: float = SHARE_IMPLICIT
) -> Choice:
    """The implicit method with error control."""
    return Choice(METHODS["implicit"], dt, tolerance or _substep_tolerance(plant, share), reason)


def _substep_tolerance(plant: Plant, share: float) -> float:
    """Tolerance that leaves a sub-step a share of the scene's accuracy."""
    lower, upper = TOLERANCE_RANGE
    return min(max(share * plant.model.scene.sim.accuracy, 10.0 * lower), upper)


def _variation(plant: Plant, dt: float) -> str:
    """What changes within a step if a joint moves, or slides off, as text; empty if nothing does.

    Forces with a wavelength change as fast as the joint turns, and a user may set any speed.
    """
    model = plant.model
    motors = [drive for drive in model.drives if drive]
    if model.friction.by_position:
        return "friction varies with the position"
    if any(drive.motor.cogging for drive in motors):
        return "cogging varies with the position"
    if any(drive.coupling and drive.coupling.kinematic_error for drive in motors):
        return "gears vary with the position"
    fall = model.friction.steepest_fall
    if not fall.any():
        return ""
    try:
        mobility = np.diag(np.linalg.inv(Dynamics(model).mass_matrix(model.q0)))
    except np.linalg.LinAlgError:
        return ""
    rate, joint = max(zip((fall * mobility).tolist(), model.joint_names, strict=True))
    if rate * dt <= STRIBECK_RATE:
        return ""
    return f"falling friction speeds a joint up in {1.0 / rate:.2g} s ('{joint}')"


def _has_swings(samples: list[LinearResponse], dt: float) -> bool:
    """Whether a spring or a stop moves a joint faster than steps of fixed length resolve."""
    return any(
        response.cause(mode)[0] in (SPRINGS, STOPS)
        for response in samples
        for mode in np.flatnonzero(abs(response.modes[0]) * dt > SWING).tolist()
    )


def _instability(plant: Plant, method: Method, dt: float) -> str:
    """Why a method is unstable in steps of ``dt``, and what would do; empty if it is stable."""
    unstable = [response for response in responses(plant) if is_unstable(method, response, dt)]
    if not unstable:
        return ""
    longest, first = min(
        ((longest_step(method, response, dt), k) for k, response in enumerate(unstable))
    )
    why = _describe_mode(plant, unstable[first], fastest_growing_mode(method, unstable[first], dt))
    return (
        f"unstable at dt = {dt:g} s: {why}; dt up to {longest:.2g} s, 'implicit', or 'dop853' "
        "with a tolerance would do"
    )


def _fastest_mode(plant: Plant, samples: list[LinearResponse]) -> str:
    """What moves which joint in the fastest mode, and how fast."""
    stiffest = max(samples, key=lambda response: response.fastest_rate)
    return _describe_mode(plant, stiffest, stiffest.fastest_mode)


def _describe_mode(plant: Plant, response: LinearResponse, mode: int) -> str:
    """What moves which joint in a mode, and how fast."""
    part, joint = response.cause(mode)
    time = 1.0 / abs(response.modes[0][mode])
    return f"{part} a joint in {time:.2g} s ('{plant.model.joint_names[joint]}')"


def fastest_rate(plant: Plant) -> float:
    """Fastest rate of the scene in [1/s], see ``response``; 0 if nothing acts fast."""
    return max((response.fastest_rate for response in responses(plant)), default=0.0)


def law_rate(model: ArmModel) -> tuple[float, str]:
    """Fastest rate of friction with states in [1/s], and its model's title; 0 without any."""
    if not (laws := friction_laws(model)):
        return 0.0, ""
    M = Dynamics(model).mass_matrix(model.q0)
    try:
        return max((law.fastest_rate(M, model.v0), law.title) for law in laws)
    except np.linalg.LinAlgError:
        return 0.0, ""  # a joint without mass is reported by name when the plant is built


def _check_within(name: str, value: float, allowed: tuple[float, float], unit: str) -> float:
    number = real_number(value)
    if not allowed[0] <= number <= allowed[1]:
        raise InvalidInput(f"{name} = {value!r}; allowed: {allowed[0]:g} to {allowed[1]:g}{unit}")
    return number
