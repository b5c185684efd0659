# SPDX-License-Identifier: Apache-2.0
"""Selection of the integration method of a scene."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel, Dynamics, InvalidInput
from arm_dynamics.actuation.joint_laws import friction_laws
from arm_dynamics.equations import spring
from arm_dynamics.exceptions import choices
from arm_dynamics.model.tree_builder import tree_of
from arm_sim.integrators.methods import METHODS, Method
from arm_sim.plant.plant import Plant

DT_RANGE = (1e-9, 10.0)
LONG = 0.1  # [s]
TOLERANCE_RANGE = (1e-14, 1e-1)
# Explicit methods of order 4 are stable up to h λ = 2.8 (Hairer, Wanner, Solving Ordinary
# Differential Equations II, figure IV.2.1); the rate grows as the arm folds, hence the margin.
STIFF = 1.4
# Default error per sub-step with stiff bristles: a tick takes 1.1 to 2.7 sub-steps on average, 150
# where a joint reverses, and half a second of motion is accurate to 1e-7 rad.
STIFF_LAW = 1e-6
# Drives respond within a tick, so a step of fixed length cannot be trusted: see
# docs/concepts/drives.md for the cost of these tolerances. From about this rate, the extrapolated
# implicit method is faster than DOP853.
DRIVEN_TOLERANCE = 1e-10
DRIVEN_STIFF, DRIVEN_STIFF_TOLERANCE = 50.0, 1e-8
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Choice:
    """Integration method and parameters of a scene.

    Attributes:
        method: The method.
        dt: Length of a tick in [s].
        tolerance: Scaled error per sub-step, None for one step of fixed length per tick.
        reason: Why this method was selected, as text.
    """

    method: Method
    dt: float
    tolerance: float | None
    reason: str

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
    scene = plant.model.scene
    name = integrator or scene.sim.integrator or "auto"
    if tolerance is None and integrator is None:
        tolerance = scene.sim.tolerance
    dt = _within("dt", scene.sim.dt if dt is None else dt, DT_RANGE, " s")
    if dt > LONG:
        _log.warning(
            "dt = %g s is long for a tick: a torque is held for all of it, and without a tolerance"
            " it is one step; arms are controlled every 0.001 to 0.01 s", dt,
        )  # fmt: skip
    tolerance = None if tolerance is None else _within("tolerance", tolerance, TOLERANCE_RANGE, "")
    if name not in ("auto", *METHODS):
        raise InvalidInput(f"integrator = {name!r}; allowed: {choices(name, ('auto', *METHODS))}")
    rate, law = law_rate(plant.model)
    if rate * dt > STIFF and (name == "auto" or tolerance is None):
        reason = f"{law} answers in {1 / rate:.2g} s: implicit, with error control"
        return Choice(METHODS["implicit"], dt, tolerance or STIFF_LAW, reason)
    if name == "auto":
        if plant.nz:
            return _driven(plant, dt, tolerance)
        method, reason = _automatic(plant, dt, tolerance is not None)
        return Choice(method, dt, tolerance, reason)
    method = METHODS[name]
    if tolerance is not None and not method.adaptive:
        able = ", ".join(m.name for m in METHODS.values() if m.adaptive)
        raise InvalidInput(
            f"integrator = {name!r} has no error estimate; with a tolerance: auto, {able}"
        )
    return Choice(method, dt, tolerance, "asked for")


def _automatic(plant: Plant, dt: float, error_control: bool) -> tuple[Method, str]:
    rate = fastest_rate(plant)
    if rate * dt > STIFF:
        alone = plant.laws is None and not plant.model.springs
        what = "friction stops a joint" if alone else "a joint, its drive or a spring responds"
        return METHODS["implicit"], f"stiff: {what} in {1 / rate:.2g} s"
    if error_control:
        return METHODS["dop853"], "not stiff, error control: the highest order"
    return METHODS["rk4"], "the scene is not stiff"


def _driven(plant: Plant, dt: float, tolerance: float | None) -> Choice:
    rate = fastest_rate(plant)
    if rate * dt > DRIVEN_STIFF:
        reason = f"stiff, error control: a drive answers in {1 / rate:.2g} s"
        return Choice(METHODS["implicit"], dt, tolerance or DRIVEN_STIFF_TOLERANCE, reason)
    reason = "drives with states: error control, the highest order"
    return Choice(METHODS["dop853"], dt, tolerance or DRIVEN_TOLERANCE, reason)


def fastest_rate(plant: Plant) -> float:
    """Fastest rate of the scene at its initial state, in [1/s].

    Args:
        plant: The scene's equation of motion.

    Returns:
        Largest absolute eigenvalue of the exact Jacobian ∂x'/∂x: decay of currents, springs and
        friction, and the frequency of springs; without internal states, the larger of the rates of
        friction alone and of springs alone.
    """
    if plant.laws is None:
        return max(damping_rate(plant.model), spring_rate(plant.model))
    return max(_response_rate(plant), spring_rate(plant.model))


def _response_rate(plant: Plant) -> float:
    """Largest absolute eigenvalue of ∂x'/∂x at the initial state in [1/s]."""
    plant = plant.free or plant
    x, u, p = (ca.SX.sym(name, plant.rhs.size1_in(i)) for i, name in enumerate("xup"))
    J = ca.Function("J", [x, u, p], [ca.jacobian(plant.rhs(x, u, p), x)])
    model = plant.model
    state = np.concatenate([model.q0, model.v0, plant.initial(model.q0, model.v0)])
    sliding = np.ones(p.shape[0] - len(plant.parameters.nominal))
    values = np.array(J(state, 0.0, np.concatenate([plant.parameters.nominal, sliding])))
    if not np.isfinite(values).all():
        return 0.0  # a joint without mass is reported by name when the kernel is verified
    return float(np.abs(np.linalg.eigvals(values)).max())


def law_rate(model: ArmModel) -> tuple[float, str]:
    """Fastest rate of friction with states in [1/s], and its model's title; 0 without any."""
    if not (laws := friction_laws(model)):
        return 0.0, ""
    M = Dynamics(model).mass_matrix(model.q0)
    try:
        return max((law.fastest_rate(M, model.v0), law.title) for law in laws)
    except np.linalg.LinAlgError:
        return 0.0, ""  # a joint without mass is reported by name when the plant is built


def damping_rate(model: ArmModel) -> float:
    """Fastest decay that friction rising with speed causes at the initial position, in [1/s].

    Args:
        model: The robot.

    Returns:
        Largest eigenvalue of M⁻¹ diag(b), b the largest slope of each joint's friction over its
        speed; 0 if none rises.
    """
    friction = model.friction
    slope = model.viscous + abs(friction.viscous.skew) + friction.steepest_rise
    if not slope.any():
        return 0.0
    M = Dynamics(model).mass_matrix(model.q0)
    try:
        return float(np.max(np.linalg.eigvals(np.linalg.solve(M, np.diag(slope))).real))
    except np.linalg.LinAlgError:
        return 0.0  # as in ``law_rate``


def spring_rate(model: ArmModel) -> float:
    """Fastest rate of the arm on its springs at the initial position, in [1/s].

    A cord is taken as taut: it may be slack now and pull later.

    Args:
        model: The robot.

    Returns:
        Largest absolute eigenvalue λ of M λ² + D λ + K = 0 with the springs' D and K; 0 without
        springs.
    """
    if not model.springs:
        return 0.0
    points = tuple(s.model_copy(update={"tension_only": False}) for s in model.springs.points)
    q, v = ca.SX.sym("q", model.n), ca.SX.sym("v", model.n)
    S = spring.torque(replace(model.springs, points=points), tree_of(model), q, v)
    both = ca.Function("KD", [q, v], [ca.jacobian(S, q), ca.jacobian(S, v)])
    K, D = (np.array(matrix) for matrix in both(model.q0, 0.0))
    M = Dynamics(model).mass_matrix(model.q0)
    try:
        lower = np.linalg.solve(M, -np.hstack([K, D]))
    except np.linalg.LinAlgError:
        return 0.0  # as in ``law_rate``
    upper = np.eye(model.n, 2 * model.n, model.n)
    return float(abs(np.linalg.eigvals(np.vstack([upper, lower]))).max())


def _within(name: str, value: float, allowed: tuple[float, float], unit: str) -> float:
    try:
        number = np.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not allowed[0] <= number <= allowed[1]:
        raise InvalidInput(f"{name} = {value!r}; allowed: {allowed[0]:g} to {allowed[1]:g}{unit}")
    return number
