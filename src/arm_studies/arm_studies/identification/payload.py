# SPDX-License-Identifier: Apache-2.0
"""Identification of the payload of a known arm."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.exceptions import InvalidInput, did_you_mean, known_names
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.scene.inertia import six_of
from arm_dynamics.scene.load import load_scene
from arm_dynamics.scene.schema import Payload
from arm_studies.identification import checks
from arm_studies.identification.data import records_of
from arm_studies.identification.described import central_inertia
from arm_studies.identification.names import mapped
from arm_studies.identification.preparation import EvenRecord, common_band, resampled
from arm_studies.identification.regression import bodies
from arm_studies.identification.regression.age import age_of
from arm_studies.identification.regression.bandwidth import noise_above
from arm_studies.identification.regression.estimation import (
    Mask,
    belief_of,
    deviations,
    made_possible,
    solved,
)
from arm_studies.identification.regression.intervals import STRICT, Estimate, unbiased
from arm_studies.identification.regression.regressor import RigidRegressor
from arm_studies.identification.regression.rows import Rows, steady_friction

NAMES = ("mass", *(f"com.{k}" for k in "xyz"))
# Of a payload's mass, centre of mass and inertia about it, in order.
NAMES += tuple(f"inertia.{k}" for k in "xx xy xz yy yz zz".split())
GUESS = 0.1  # Radius in [m] of the ball of 1 kg that is the weak prior of a payload.
LOOSE = 10.0
# Deviations of the arm's bodies, which stand in for the payload, where columns of efforts are
# matched with joints.
DOUBT = 0.5, 0.5


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

    def rows(self) -> list[tuple[str, float, str]]:
        """Name, value and unit of each number of the payload."""
        values = self.payload.mass, *self.payload.com, *self.payload.inertia
        return [*zip(NAMES, values, ["kg", *["m"] * 3, *["kg m²"] * 6], strict=True)]


def identify_payload(
    scene: Any, recordings: Any, frame: str, *, band: float | None = None,
    names: Mapping[str, str] | None = None, told: Callable[[str], None] = lambda text: None,
) -> Payload:  # fmt: skip
    """The payload of ``estimate_payload``, which ``told`` says what is not determined of."""
    found = estimate_payload(scene, recordings, frame, band=band, names=names, told=told)
    if found.missing:
        told(f"the motion does not determine {known_names(found.missing)}")
    return found.payload


def estimate_payload(
    scene: Any, recordings: Any, frame: str, *, band: float | None = None,
    names: Mapping[str, str] | None = None, told: Callable[[str], None] = lambda text: None,
) -> PayloadEstimate:  # fmt: skip
    """Identify the payload of an arm whose own inertias and friction are known.

    Args:
        scene: The arm without the payload, anything ``load_scene`` accepts.
        recordings: Of the arm with the payload; see ``identify``.
        frame: The frame that carries the payload and in which the result is expressed.
        band: Cut-off frequency of the low-pass filter in [Hz]; None: chosen from the noise.
        names: Joint names of the recordings by those of the scene, where they cannot be matched.
        told: Called with each irregularity of the recordings, such as rows that are left out.

    Raises:
        SceneError: If the scene cannot be used.
        InvalidInput: If the frame is unknown or fixed, or the recordings do not determine it.
    """
    model = ArmModel(load_scene(scene))
    checks.check_model(model)
    place, carrier = _carried(model, frame)
    records = [mapped(r, model.joint_names, names) for r in records_of(recordings)]
    for record in records:
        checks.check_record(record, model)
    carried = _Carried(model, [resampled(record) for record in records], band, place, carrier)
    for note in dict.fromkeys(carried.notes):
        told(note)
    mass, com, inertia = central_inertia(carried.x)
    values = np.array([mass, *com, *six_of(inertia)])
    estimates = dict(zip(NAMES, carried.estimated(values), strict=True))
    most = [mass, *[np.inf] * 3, *[0.5 * np.trace(inertia)] * 6]  # of any body, up to its sign
    known = {name: e for name, e in estimates.items() if np.isfinite(e.high)}
    missing = [
        name for name, bound in zip(NAMES, most, strict=True)
        if not estimates[name].high - estimates[name].value < bound
    ]  # fmt: skip
    _, *com, xx, xy, xz, yy, yz, zz = values.tolist()
    payload = Payload(frame=frame, mass=mass, com=tuple(com), inertia=(xx, xy, xz, yy, yz, zz))
    intervals = {name: (e.low, e.high) for name, e in known.items()}
    scatter = frozenset(name for name, e in known.items() if e.scatter)
    return PayloadEstimate(payload, intervals, scatter, tuple(missing))


class _Carried:
    """The regression of what the arm alone does not explain.

    Attributes:
        rows: Of the arm without the payload.
        columns: Of the payload in its frame, shape (n, k, 10).
        torque: What it explains, shape (k, n).
        weights: Of each joint; zero where not used, shape (k, n).
        x: The payload's inertial parameters, physically consistent.
        notes: Irregularities of the recordings.
    """

    def __init__(
        self, model: ArmModel, recordings: Sequence[EvenRecord], band: float | None,
        place: pin.SE3, carrier: int,
    ) -> None:  # fmt: skip
        self._model, self._regressor, self._recordings = model, RigidRegressor(model), recordings
        self._band = common_band(recordings) if band is None else band
        self._moved, self._places = _moved(place), self._regressor.places(carrier)
        self.notes = [note for each in recordings for note in each.notes]
        self._at(0.0)
        checks.moved(self.rows.motions)
        checks.check_rows(self.rows, model.joint_names, self.notes)
        nominal = self._regressor.nominal
        near = belief_of(nominal, len(nominal), *DOUBT)
        late = checks.check_columns(self.rows, self.rows.use, near, model.joint_names)
        self.notes += late
        self._regress()
        left = self.torque - (self.columns @ self.x).T
        narrow = noise_above(self.rows, self.rows.use, left) if band is None else None
        if narrow is not None:
            self._band = narrow
            self._at(0.0)
        self._fit()
        if not all(motion.aged for motion in self.rows.motions) and len(late) in (0, model.n):
            self.notes += age_of(self._corrected, self.rows.band)[1]

    def _at(self, age: float) -> None:
        """Compare efforts of this age with the motion."""
        self._age = age
        motions = [each.filtered(self._band, age) for each in self._recordings]
        self.rows = Rows(self._regressor, motions, held_out=0.0)

    def _corrected(self, age: float) -> tuple[float, float]:
        """The correction of an age of the efforts, and its standard deviation."""
        if age != self._age:
            self._at(age)
            self._fit()
        found, doubt, *_ = self._unbiased(self.columns, self.torque)
        return float(found[-1]), float(doubt[-1])

    def _fit(self) -> None:
        """Clear rows of what joints may cause while they stick, and fit them again."""
        self._regress()
        rest, friction = np.full_like(self.rows.v, 1e-9), SteadyFriction.of(self._model)
        levels = abs(friction(rest, np.sign(rest), 0.0 * rest, self.rows.effort)).mean(axis=0)
        sizes = 1.0 / np.maximum(self.weights.max(axis=0), 1e-300)
        self.rows = self.rows.cleared(STRICT * levels, sizes)
        self._regress()

    def _regress(self) -> None:
        """Weight the joints, and fit the payload."""
        rows, self.torque = self.rows, self.rows.effort - self._alone(self.rows)
        self.columns = np.swapaxes(rows.rigid[:, :, self._places] @ self._moved, 0, 1)
        left = [
            y - c @ np.linalg.lstsq(c[used], y[used], rcond=1e-10)[0]
            for c, y, used in zip(self.columns, self.torque.T, rows.use.T, strict=True)
        ]
        self.weights = rows.use / deviations(rows.effort, rows.effort - np.array(left).T, rows.use)
        flat = (self.columns * self.weights.T[:, :, None]).reshape(-1, 10)
        y, count = (self.weights * self.torque).T.ravel(), np.sqrt(rows.independent)
        T, z = belief_of(_ball(), 10, LOOSE, LOOSE).combined(count * flat, count * y)
        self.x = solved(T, z)
        if not bodies.possible(self.x, 1e-9):
            self.x = made_possible(T, z, _ball(), _ball(), ())

    def _alone(self, rows: Rows) -> Array:
        """Efforts without the payload, shape (k, n)."""
        plain, nominal, rotors = rows.plain, self._regressor.nominal, self._model.armature
        load = plain.rigid @ nominal + plain.known + plain.inertia * rotors
        return rows.clear(np.asarray(load + steady_friction(plain, load)))

    def estimated(self, values: Array) -> list[Estimate]:
        """Estimates of mass, centre of mass and inertia near some values, without the prior."""
        step = 1e-20  # of the complex-step derivative
        slopes = [_numbers(values + 1j * step * unit).imag / step for unit in np.eye(len(NAMES))]
        left = self.torque - (self.columns @ _numbers(values)).T
        more, doubt, scatter, _ = self._unbiased(self.columns @ np.column_stack(slopes), left)
        found = values + more[: len(NAMES)]
        return [*map(Estimate.of, found.tolist(), doubt.tolist(), scatter.tolist())]

    def _unbiased(self, columns: Array, left: Array) -> tuple[Array, Array, Mask, float]:
        rows, theta = self.rows, self._regressor.nominal + self._regressor.payload
        theta[self._places] += self._moved @ self.x
        plain = rows.plain
        predicted = self._alone(plain) + plain.rigid[:, :, self._places] @ self._moved @ self.x
        noise = self.weights.max(axis=0) * rows.noise(theta, self._model.armature)
        size = float(np.linalg.norm(self.weights * self.torque))
        ageing = self.weights * rows.ageing(predicted)
        own, y = columns * self.weights.T[:, :, None], self.weights * left
        return unbiased(rows, own, y, ageing, noise, size)


def _numbers(values: Any) -> Any:
    """Ten inertial parameters from mass, centre of mass and inertia about it, also complex."""
    mass, com, inertia = values[0], values[1:4], values[4:][[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    density = 0.5 * np.trace(inertia) * np.eye(3) - inertia + mass * np.outer(com, com)
    first = mass * com[:, None]
    return bodies.numbers_of(np.block([[density, first], [first.T, mass * np.eye(1)]]))


def _carried(model: ArmModel, frame: str) -> tuple[pin.SE3, int]:
    """The placement of a frame in the body that carries it, and the index of that body."""
    if not model.has_frame(frame):
        raise InvalidInput(
            f"unknown frame '{frame}'{did_you_mean(frame, model.frame_names)}; the arm has "
            f"{known_names(model.frame_names)}"
        )
    found = model.frame(frame)
    if found.parentJoint == 0:
        raise InvalidInput(f"frame '{frame}' is fixed to the base; a moving frame is expected")
    return found.placement, found.parentJoint - 1


def _moved(place: pin.SE3) -> Array:
    """Map from inertial parameters in a frame to those in its body's joint, shape (10, 10)."""
    G = place.homogeneous
    return np.column_stack([bodies.numbers_of(G @ basis @ G.T) for basis in bodies.BASIS])


def _ball() -> Array:
    return bodies.numbers_of(np.diag([GUESS**2 / 5.0] * 3 + [1.0]))
