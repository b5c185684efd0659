# SPDX-License-Identifier: Apache-2.0
"""Identification of the payload of a known arm."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.exceptions import known_names
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.frame_motion import check_moving
from arm_dynamics.scene.inertia import six_of
from arm_dynamics.scene.schema import Payload
from arm_studies._renaming import renamed_argument
from arm_studies.identification import checks
from arm_studies.identification.identified_scene import central_inertia
from arm_studies.identification.regression import bodies, estimation, uncertainty
from arm_studies.identification.regression.bandwidth import noise_frequency
from arm_studies.identification.regression.efforts import with_age
from arm_studies.identification.regression.regressor import PER_BODY
from arm_studies.identification.regression.rows.rows import ArmRecordings, Rows, nominal_efforts

# Names of a payload's mass, centre of mass and inertia about it, in order.
NAMES = ("mass", *(f"com.{k}" for k in "xyz"))
NAMES += tuple(f"inertia.{k}" for k in "xx xy xz yy yz zz".split())
PRIOR_RADIUS = 0.1  # Radius in [m] of the ball of 1 kg that is the weak prior of a payload.
PRIOR_WIDTH = 10.0  # Its relative standard deviations, of density and of all else.
# Deviations of the arm's bodies, which stand in for the payload, where columns of efforts are
# matched with joints.
ARM_DEVIATIONS = 0.5, 0.5


@frozen
class PayloadEstimate:
    """A payload, and how surely it is known.

    Attributes:
        payload: For ``payloads`` of a scene; physically consistent.
        intervals: 95 % confidence intervals by name, of least squares alone: ``mass``, ``com.x``,
            ``inertia.xx`` and so on, in SI units.
        scatter: Names of those that are no 95 % intervals; see ``Identification``.
        missing: Names of what the motion does not determine: no interval is known, or one that is
            wider than what any body has.
    """

    payload: Payload
    intervals: Mapping[str, tuple[float, float]]
    scatter: frozenset[str]
    missing: tuple[str, ...]

    def __repr__(self) -> str:
        """A summary: each number with its interval, and what is not determined."""
        lines = []
        for name, value, unit in self.rows():
            interval = self.intervals.get(name)
            remark = ", {:.4g} to {:.4g}".format(*interval) if interval else ""
            remark += " (scatter)" if name in self.scatter else ""
            remark = ": the motion does not determine it" if name in self.missing else remark
            lines.append(f"{name} {value:.4g} {unit}{remark}")
        return f"<PayloadEstimate on {self.payload.frame}:\n  " + "\n  ".join(lines) + ">"

    def rows(self) -> list[tuple[str, float, str]]:
        """Name, value and unit of each number of the payload."""
        values = self.payload.mass, *self.payload.com, *self.payload.inertia
        return [*zip(NAMES, values, ["kg", *["m"] * 3, *["kg m²"] * 6], strict=True)]


@renamed_argument("told", "on_note")
def identify_payload(
    scene: Any, recordings: Any, frame: str, *, band: float | None = None,
    names: Mapping[str, str] | None = None, on_note: Callable[[str], None] = lambda note: None,
) -> Payload:  # fmt: skip
    """The payload of ``estimate_payload``; ``on_note`` also gets what is not determined."""
    estimate = estimate_payload(scene, recordings, frame, band=band, names=names, on_note=on_note)
    if estimate.missing:
        on_note(f"the motion does not determine {known_names(estimate.missing)}")
    return estimate.payload


@renamed_argument("told", "on_note")
def estimate_payload(
    scene: Any, recordings: Any, frame: str, *, band: float | None = None,
    names: Mapping[str, str] | None = None, on_note: Callable[[str], None] = lambda note: None,
) -> PayloadEstimate:  # fmt: skip
    """Identify the payload of an arm whose own inertias and friction are known.

    Args:
        scene: The arm without the payload, anything ``load_scene`` accepts.
        recordings: Of the arm with the payload; see ``identify``.
        frame: The frame that carries the payload and in which the result is expressed.
        band: Cut-off frequency of the low-pass filter in [Hz]; None: chosen from the noise.
        names: Joint names of the recordings by those of the scene, where they cannot be matched.
        on_note: Called with each irregularity of the recordings, such as rows that are left out.

    Raises:
        SceneError: If the scene cannot be used.
        InvalidInput: If the frame is unknown or fixed, or the recordings do not determine it.
    """
    model, records = checks.usable_inputs(scene, recordings, names)
    fitted = partial(_fitted, *_payload_columns(model, frame))
    data = ArmRecordings.of(model, records, band, held_out=0.0)
    rows, notes = data.rows(), data.notes
    near = estimation.Prior.near(data.regressor.nominal, *ARM_DEVIATIONS)
    _, delay_notes = checks.check_rows(estimation.Problem(rows, rows.samples.use, near), notes)
    if band is None:
        limit = noise_frequency(rows, rows.samples.use, fitted(rows).residual)
        if limit is not None:
            data = replace(data, band=limit)
            rows = data.rows()

    def fit_at(age: float) -> tuple[_Fit, float, float]:
        """The fit at an age of the efforts, its correction, and the latter's deviation."""
        fit = _without_sticking(fitted(rows if age == 0.0 else replace(data, age=age).rows()))
        solution = fit.unbiased(fit.columns, fit.torque)
        return fit, float(solution.values[-1]), float(solution.deviations[-1])

    # One age of all efforts is fitted unless it is known, or only some joints' efforts are late.
    has_ages, age_notes = all(m.aged for m in rows.samples.motions), list[str]()
    if has_ages or len(delay_notes) not in (0, model.n):
        fit = _without_sticking(fitted(rows))
    else:
        fit, age_notes = with_age(fit_at, rows.samples.band)
    for note in dict.fromkeys([*notes, *delay_notes, *age_notes]):
        on_note(note)
    return _assessed(fit, frame)


@dataclass(frozen=True)
class _Fit:
    """The regression of what the arm alone does not explain.

    Attributes:
        rows: Of the arm without the payload.
        places: Of the parameters of the body that carries the payload.
        to_carrier: Map from the payload's parameters in its frame to those in that body's joint,
            shape (10, 10).
        columns: Of the payload in its frame, shape (n, k, 10).
        torque: What it explains, shape (k, n).
        weights: Of each joint; zero where not used, shape (k, n).
        x: The payload's ten inertial parameters, physically consistent.
    """

    rows: Rows
    places: slice
    to_carrier: Array
    columns: Array
    torque: Array
    weights: Array
    x: Array

    @property
    def residual(self) -> Array:
        """Torques that are left, shape (k, n)."""
        return self.torque - (self.columns @ self.x).T

    def unbiased(self, columns: Array, torque: Array) -> uncertainty.Unbiased:
        """The unknowns of some columns, without the prior."""
        rows, regressor = self.rows, self.rows.samples.regressor
        theta, body = regressor.nominal + regressor.payload, self.to_carrier @ self.x
        theta[self.places] += body
        unwhitened = rows.unwhitened
        predicted = nominal_efforts(unwhitened) + unwhitened.rigid[:, :, self.places] @ body
        noise = self.weights.max(axis=0) * rows.noise(theta, regressor.model.armature)
        own, ageing = columns * self.weights.T[:, :, None], self.weights * rows.ageing(predicted)
        size = float(np.linalg.norm(self.weights * self.torque))
        return uncertainty.unbiased(rows, own, self.weights * torque, ageing, noise, size)


def _fitted(places: slice, to_carrier: Array, rows: Rows) -> _Fit:
    """Weight the joints, and fit the payload."""
    torque = rows.effort - rows.whiten(nominal_efforts(rows.unwhitened))
    columns = np.swapaxes(rows.rigid[:, :, places] @ to_carrier, 0, 1)
    residual = [
        y - c @ np.linalg.lstsq(c[used], y[used], rcond=1e-10)[0]
        for c, y, used in zip(columns, torque.T, rows.samples.use.T, strict=True)
    ]
    predicted = rows.effort - np.array(residual).T
    weights = rows.samples.use / estimation.deviations(rows.effort, predicted, rows.samples.use)
    flat = (columns * weights.T[:, :, None]).reshape(-1, PER_BODY)
    y, count = (weights * torque).T.ravel(), np.sqrt(rows.samples.independent)
    ball = bodies.inertial_parameters(np.diag([PRIOR_RADIUS**2 / 5.0] * 3 + [1.0]))
    T, z = estimation.Prior.near(ball, PRIOR_WIDTH, PRIOR_WIDTH).combined(count * flat, count * y)
    x = estimation.solved(T, z)
    if not bodies.consistent(x, 1e-9):
        x = estimation.consistent_solution(T, z, ball, ball, ())
    return _Fit(rows, places, to_carrier, columns, torque, weights, x)


def _without_sticking(fit: _Fit) -> _Fit:
    """Clear rows of what joints may cause while they stick, and fit them again."""
    rows, samples = fit.rows, fit.rows.samples
    rest, friction = np.full_like(samples.v, 1e-9), SteadyFriction.of(samples.regressor.model)
    levels = abs(friction(rest, np.sign(rest), 0.0 * rest, rows.effort)).mean(axis=0)
    sizes = 1.0 / np.maximum(fit.weights.max(axis=0), 1e-300)
    rows = rows.whitened(uncertainty.UNKNOWN_FRICTION * levels, sizes)
    return _fitted(fit.places, fit.to_carrier, rows)


def _assessed(fit: _Fit, frame: str) -> PayloadEstimate:
    """The payload of a fit, its intervals, and what is not determined."""
    mass, com, inertia = central_inertia(fit.x)
    values = np.array([mass, *com, *six_of(inertia)])
    estimates = dict(zip(NAMES, _estimated(fit, values), strict=True))
    # Of any body: no moment of inertia exceeds the sum of the other two, no product half of one.
    largest = [mass, *[np.inf] * 3, *[0.5 * np.trace(inertia)] * 6]
    missing = tuple(
        name for (name, e), bound in zip(estimates.items(), largest, strict=True)
        if not e.high - e.value < bound
    )  # fmt: skip
    bounded = {name: e for name, e in estimates.items() if np.isfinite(e.high)}
    _, *com, xx, xy, xz, yy, yz, zz = values.tolist()
    return PayloadEstimate(
        payload=Payload(frame=frame, mass=mass, com=tuple(com), inertia=(xx, xy, xz, yy, yz, zz)),
        intervals={name: (e.low, e.high) for name, e in bounded.items()},
        scatter=frozenset(name for name, e in bounded.items() if e.scatter),
        missing=missing,
    )


def _estimated(fit: _Fit, values: Array) -> list[uncertainty.Estimate]:
    """Estimates of mass, centre of mass and inertia near some values, without the prior."""
    step = 1e-20  # of the complex-step derivative
    slopes = [_numbers(values + 1j * step * unit).imag / step for unit in np.eye(len(NAMES))]
    residual = fit.torque - (fit.columns @ _numbers(values)).T
    change = fit.unbiased(fit.columns @ np.column_stack(slopes), residual)
    totals = values + change.values[: len(NAMES)]
    columns = totals.tolist(), change.deviations.tolist(), change.scatter.tolist()
    return [*map(uncertainty.Estimate.of, *columns)]


def _numbers(values: Any) -> Any:
    """Ten inertial parameters from mass, centre of mass and inertia about it, also complex."""
    mass, com, inertia = values[0], values[1:4], values[4:][[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    density = 0.5 * np.trace(inertia) * np.eye(3) - inertia + mass * np.outer(com, com)
    first = mass * com[:, None]
    return bodies.inertial_parameters(np.block([[density, first], [first.T, mass * np.eye(1)]]))


def _payload_columns(model: ArmModel, frame: str) -> tuple[slice, Array]:
    """``places`` and ``to_carrier`` of ``_Fit``, for a payload on a frame."""
    check_moving(model, frame)
    entry = model.frame(frame)
    first, G = PER_BODY * (entry.parentJoint - 1), entry.placement.homogeneous
    transforms = [bodies.inertial_parameters(G @ basis @ G.T) for basis in bodies.BASIS]
    return slice(first, first + PER_BODY), np.column_stack(transforms)
