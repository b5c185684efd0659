# SPDX-License-Identifier: Apache-2.0
"""The fit of one set of friction laws: bodies, armatures, coefficients and shapes of friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.regression import estimation, friction
from arm_studies.identification.regression.estimation import Columns, Problem
from arm_studies.identification.regression.friction import JointFit, Shape, ShapeParameter
from arm_studies.identification.regression.rows.rows import Rows

SIGNED = (friction.COULOMB_SKEW, friction.VISCOUS_SKEW, friction.EXCESS)
STEPS = 25  # Largest number of steps of Gauss-Newton.
# First steps, which are accepted even if they are worse: each changes the weights and the loads
# under which friction is computed, so that the costs of two of them do not compare.
FIRST_STEPS = 4
# Factors of the length of steps after a worse and after a better one, and the length at which
# they end; one is a whole step.
SHORTENING, LENGTHENING, SHORTEST = 0.3, 2.0, 1e-2
ROUNDING = 1e-12  # Change of the cost below which it is rounding.
REMOVALS = 4  # Largest number of fits until no law has a term of an impossible coefficient.
LEAST_LOAD = 0.01  # Share of the dry friction that grows with the load below which none does.
# ``tolerance`` of results: then shapes are known far better than any noise lets them be.
TOLERANCE = 1e-6


@dataclass(frozen=True)
class Fit:
    """Result of a fit.

    Attributes:
        problem: What was fitted.
        x: Bodies, armatures and friction, shape (size,).
        friction: Of each joint, with its coefficients.
        columns: The regression at the end.
        weights: Of each joint, shape (n,).
        load: Torques of the drives under which its friction was computed, shape (k, n).
        is_corrected: Whether bodies had to be changed to be physically consistent.
    """

    problem: Problem
    x: Array
    friction: tuple[JointFit, ...]
    columns: Columns
    weights: Array
    load: Array
    is_corrected: bool = False

    @property
    def rows(self) -> Rows:
        """The regression's rows."""
        return self.problem.rows

    @property
    def theta(self) -> Array:
        """Inertial parameters of the bodies."""
        return self.x[: len(self.problem.prior.x0)]

    @property
    def armature(self) -> Array:
        """Inertia of each joint's drive, shape (n,)."""
        first = len(self.problem.prior.x0)
        return self.x[first : first + self.rows.samples.n]

    @cached_property
    def residual(self) -> Array:
        """Efforts that it does not explain, shape (k, n)."""
        return np.asarray(self.problem.target - self.columns.predicted(self.x))

    @cached_property
    def drives(self) -> Array:
        """Torques of the drives, which are all that it predicts, shape (k, n)."""
        return np.asarray(self.columns.predicted(self.x) + self.rows.known_torques)

    def predicted(self, rows: Rows) -> Array:
        """Efforts of the same motion in rows with another bandwidth, shape (k, n)."""
        rigid = rows.rigid @ self.theta + rows.inertia * self.armature
        return np.asarray(rows.known_torques + rigid + self.predicted_friction(rows))

    def predicted_friction(self, rows: Rows) -> Array:
        """Friction of the joints in rows with another bandwidth, shape (k, n)."""
        load = self.columns.predicted(self.x) + rows.known_torques
        torques = [
            rows.friction(law, j, load[:, j]) @ [law.coefficients[kind] for kind in law.kinds]
            for j, law in enumerate(self.friction)
        ]
        return np.column_stack(torques)

    def unfitted(self, **changes: Any) -> Fit:
        """The same numbers beside other ``rows``, ``use`` or ``prior``, not fitted to them yet."""
        return replace(self, problem=replace(self.problem, **changes))

    def refitted(self, **changes: Any) -> Fit:
        """A fit of the same laws to other ``rows``, ``use`` or ``prior``."""
        return fitted(replace(self.problem, **changes), self.friction)

    @cached_property
    def with_shapes(self) -> tuple[Columns, list[tuple[int, ShapeParameter]]]:
        """The columns with the shapes as more unknowns, see ``linearized``."""
        return linearized(self, self.drives)


def fitted(problem: Problem, laws: Sequence[JointFit], tolerance: float = TOLERANCE) -> Fit:
    """Fit all unknowns: linear ones in one step, shapes of friction by Gauss-Newton.

    Args:
        problem: Rows and prior.
        laws: Friction of each joint, with first guesses of its shapes.
        tolerance: Change of the sum of the logarithms of the joints' residuals at which shapes
            have converged.
    """
    target, use = problem.target, problem.use
    laws = [_determinable(problem.rows.samples.v[use[:, j], j], law) for j, law in enumerate(laws)]
    load = np.zeros_like(target)
    weights = 1.0 / estimation.deviations(target, load, use)
    fastest = abs(problem.rows.samples.v).max(axis=0)
    for _ in range(REMOVALS):
        fit = _converged(problem, laws, load, weights, tolerance)
        laws = [_without_inadmissible(law, fastest[j]) for j, law in enumerate(fit.friction)]
        before, after = ([(law.kinds, law.nonlinear) for law in x] for x in (fit.friction, laws))
        if before == after:
            break
        load, weights = fit.load, fit.weights
    return fit


def _determinable(v: Array, law: JointFit) -> JointFit:
    """The law without terms that a joint at rest, or moving one way only, cannot determine."""
    if not v.size or np.sqrt(np.mean(v**2)) < 1e-9:
        return JointFit(())
    if (v > 0.0).all() or (v < 0.0).all():
        plain = (friction.VISCOUS, friction.COULOMB)
        return JointFit(tuple(k for k in law.kinds if k in plain), law.shape)
    return law


def _converged(
    problem: Problem, laws: Sequence[JointFit], load: Array, weights: Array, tolerance: float
) -> Fit:
    """The fit of laws at whose shapes the steps of Gauss-Newton end, possible or not."""
    rows, accepted_cost, length = problem.rows, np.inf, 1.0
    accepted: Fit | None = None
    for step in range(STEPS):
        parts = [rows.friction(law, j, load[:, j]) for j, law in enumerate(laws)]
        columns = Columns.of(problem.common, parts)
        x = estimation.solved(*problem.combined(columns, weights))
        fit = Fit(problem, x, with_coefficients(laws, x, columns.size), columns, weights, load)
        deviation = estimation.deviations(problem.target, columns.predicted(x), problem.use)
        cost = float(np.log(deviation).sum())
        gain = accepted_cost - cost
        if step > FIRST_STEPS and gain < -ROUNDING and accepted is not None:
            length *= SHORTENING
            if -gain < tolerance or length < SHORTEST:
                break
            laws = _stepped(accepted, length)
            continue
        accepted_cost, accepted, laws = cost, fit, fit.friction
        weights, load = 1.0 / deviation, fit.drives
        has_shapes = any(law.nonlinear for law in laws)
        if step + 1 >= FIRST_STEPS and (not has_shapes or abs(gain) < tolerance):
            break
        if has_shapes:
            length = min(1.0, LENGTHENING * length)
            laws = _stepped(replace(fit, weights=weights, load=load), length)
    assert accepted is not None
    return accepted


def with_coefficients(laws: Sequence[JointFit], x: Array, size: int) -> tuple[JointFit, ...]:
    """The laws with the coefficients at the end of x."""
    ends = np.cumsum([len(law.kinds) for law in laws])
    parts = np.split(x[size - ends[-1] : size], ends[:-1])
    return tuple(
        replace(law, coefficients=dict(zip(law.kinds, values.tolist(), strict=True)))
        for law, values in zip(laws, parts, strict=True)
    )


def _stepped(fit: Fit, length: float) -> list[JointFit]:
    """Laws whose shapes have made a Gauss-Newton step, with all linear unknowns free."""
    columns, parameters = linearized(fit, fit.load)
    x = estimation.solved(*fit.problem.combined(columns, fit.weights))
    steps = length * np.clip(x[fit.columns.size :], -friction.LARGEST_STEP, friction.LARGEST_STEP)
    laws = list(fit.friction)
    for (j, parameter), change in zip(parameters, steps.tolist(), strict=True):
        laws[j] = replace(laws[j], shape=laws[j].shape.moved(parameter, change))
    return laws


def linearized(fit: Fit, load: Array) -> tuple[Columns, list[tuple[int, ShapeParameter]]]:
    """The columns of a fit with its shapes as more unknowns, linearized.

    Returns:
        The columns, and the joint and the parameter that each further unknown changes.
    """
    parameters = [(j, item) for j, law in enumerate(fit.friction) for item in law.nonlinear]
    slopes = [_slopes(fit.rows, law, j, load[:, j]) for j, law in enumerate(fit.friction)]
    joints = np.array([j for j, _ in parameters])
    places = [np.flatnonzero(joints == j) for j in range(len(fit.friction))]
    return fit.columns.extended(slopes, places, len(parameters)), parameters


def _slopes(rows: Rows, law: JointFit, j: int, load: Array) -> Array:
    """Derivatives of a joint's friction by the parameters of its shape, shape (k, parameters)."""
    if not law.nonlinear:
        return np.empty((len(load), 0))
    coefficients = [law.coefficients[kind] for kind in law.kinds]

    def torque(shape: Shape) -> Array:
        return np.asarray(rows.samples.sliding(replace(law, shape=shape), j, load) @ coefficients)

    h, current, slopes = 1e-6, torque(law.shape), []  # h: of a difference
    for parameter in law.nonlinear:
        shape, span = law.shape.moved(parameter, h), h
        if shape == law.shape:  # at its upper bound
            shape, span = law.shape.moved(parameter, -h), -h
        if parameter.kind == "load":  # as far as its bounds let it move
            span = (shape.load or 0.0) - (law.shape.load or 0.0)
        slopes.append((torque(shape) - current) / span)
    return rows.filtered(np.column_stack(slopes), j)


def _without_inadmissible(law: JointFit, fastest: float) -> JointFit:
    """The law without terms of impossible coefficients, such as negative friction.

    Args:
        law: The law.
        fastest: Largest speed of the joint, at which friction must have changed from its level at
            rest; else the change is viscous friction.
    """
    c, shape, steepness = law.coefficients, law.shape, law.steepness
    kinds = [k for k in law.kinds if k in SIGNED or c[k] > 0.0]
    level = c.get(friction.COULOMB, 0.0)
    if friction.EXCESS in kinds and (
        level <= 0.0
        or c[friction.EXCESS] < -friction.LARGEST_SHARE * level
        or (shape.stribeck_velocity or 0.0) > fastest
    ):  # the other terms may be possible without it
        kinds = [k for k in law.kinds if k != friction.EXCESS]
    if friction.VISCOUS_SKEW in kinds and friction.VISCOUS not in kinds:
        kinds.remove(friction.VISCOUS_SKEW)
    if friction.EXCESS not in kinds:
        shape = replace(shape, stribeck_velocity=None)
    if shape.load is not None:
        at, factor = shape.table
        growth = level * float((np.diff(factor) / np.diff(at)).max())  # torque over load
        if growth > friction.LARGEST_GROWTH:
            steepness = growth
        if (
            friction.COULOMB not in kinds
            or shape.load <= LEAST_LOAD
            or growth > friction.LARGEST_GROWTH
        ):
            shape = replace(shape, load=None)
    return replace(law, kinds=tuple(kinds), shape=shape, steepness=steepness)
