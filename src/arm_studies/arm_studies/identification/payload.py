# SPDX-License-Identifier: Apache-2.0
"""Identification of the payload of a known arm."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin

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
from arm_studies.identification.preparation import prepare
from arm_studies.identification.regression import bodies
from arm_studies.identification.regression.estimation import (
    NOISELESS,
    belief_of,
    made_possible,
    solved,
)
from arm_studies.identification.regression.intervals import Estimate, determined
from arm_studies.identification.regression.regressor import RigidRegressor
from arm_studies.identification.regression.rows import Rows, steady_friction

NAMES = (
    "mass",
    *(f"com.{k}" for k in "xyz"),
    *(f"inertia.{k}" for k in "xx xy xz yy yz zz".split()),
)
"""Of a payload's mass, centre of mass and inertia about it, in order."""
GUESS = 0.1
"""Radius in [m] of the ball of 1 kg that is the weak prior of a payload."""
LOOSE = 10.0
DOUBT = 0.5, 0.5
"""Deviations of the arm's bodies, which stand in for the payload, where columns of efforts are
matched with joints."""


@frozen
class PayloadEstimate:
    """A payload, and how surely it is known.

    Attributes:
        payload: For ``payloads`` of a scene; physically consistent.
        intervals: 95 % confidence intervals by name, of least squares alone: ``mass``, ``com.x``,
            ``inertia.xx`` and so on, in SI units.
        missing: Names of what the motion does not determine: no interval is known, or one that is
            wider than what any body has.
    """

    payload: Payload
    intervals: Mapping[str, tuple[float, float]]
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
    rows, notes = _checked_rows(model, recordings, band, names)
    for note in dict.fromkeys(notes):
        told(note)
    columns, y = _regression(rows, _moved(place), carrier)
    R, z = _triangle(columns, y, rows.independent)
    belief = belief_of(_ball(), 10, LOOSE, LOOSE)
    T, z = belief.combined(R, z)
    x = solved(T, z)
    if not bodies.possible(x, 1e-9):
        x = made_possible(T, z, _ball(), _ball(), ())
    mass, com, inertia = central_inertia(x)
    values = np.array([mass, *com, *six_of(inertia)])
    estimates = dict(zip(NAMES, _estimated(rows, columns, y, values), strict=True))
    most = [mass, *[np.inf] * 3, *[0.5 * np.trace(inertia)] * 6]  # of any body, up to its sign
    known = {name: (e.low, e.high) for name, e in estimates.items() if np.isfinite(e.high)}
    missing = [
        name for name, bound in zip(NAMES, most, strict=True)
        if not estimates[name].high - estimates[name].value < bound
    ]  # fmt: skip
    _, *com, xx, xy, xz, yy, yz, zz = values.tolist()
    payload = Payload(frame=frame, mass=mass, com=tuple(com), inertia=(xx, xy, xz, yy, yz, zz))
    return PayloadEstimate(payload, known, tuple(missing))


def _estimated(rows: Rows, columns: Array, y: Array, values: Array) -> list[Estimate]:
    """Estimates of mass, centre of mass and inertia near some values, without the prior."""
    step = 1e-20  # of the complex-step derivative
    slopes = [_numbers(values + 1j * step * unit).imag / step for unit in np.eye(len(NAMES))]
    left, columns = y - columns @ _numbers(values), columns @ np.column_stack(slopes)
    R, z = _triangle(columns, left, 1.0)
    found, doubt, _ = determined(rows, R, z, columns, left.T, float(np.linalg.norm(y)))
    return [*map(Estimate.of, (values + found).tolist(), doubt.tolist())]


def _numbers(values: Any) -> Any:
    """Ten inertial parameters from mass, centre of mass and inertia about it, also complex."""
    mass, com, inertia = values[0], values[1:4], values[4:][[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    density = 0.5 * np.trace(inertia) * np.eye(3) - inertia + mass * np.outer(com, com)
    first = mass * com[:, None]
    return bodies.numbers_of(np.block([[density, first], [first.T, mass * np.eye(1)]]))


def _checked_rows(
    model: ArmModel, recordings: Any, band: float | None, names: Mapping[str, str] | None
) -> tuple[Rows, list[str]]:
    """Rows of all recordings, and irregularities of these."""
    records = [mapped(r, model.joint_names, names) for r in records_of(recordings)]
    for record in records:
        checks.check_record(record, model)
    motions = [prepare(record, band) for record in records]
    checks.moved(motions)
    rows = Rows(RigidRegressor(model), motions, held_out=0.0)
    notes = [note for motion in motions for note in motion.notes]
    checks.check_rows(rows, model.joint_names, notes)
    nominal = rows.regressor.nominal
    near = belief_of(nominal, len(nominal), *DOUBT)
    notes += checks.check_columns(rows, rows.use, near, model.joint_names)
    return rows, notes


def _regression(rows: Rows, moved: Array, carrier: int) -> tuple[Array, Array]:
    """Weighted regression of what the arm alone does not explain, zero in rows not used.

    Args:
        rows: Of the arm without the payload.
        moved: The carrier's parameters from those of the payload in its frame, shape (10, 10).
        carrier: The body that carries it.

    Returns:
        Columns of shape (n, k, 10), and torques of shape (n, k).
    """
    model = rows.regressor.model
    known = rows.rigid @ rows.regressor.nominal + rows.known + rows.inertia * model.armature
    left = (rows.effort - known - steady_friction(rows, known)).T
    columns = np.swapaxes(rows.rigid[:, :, rows.regressor.places(carrier)] @ moved, 0, 1)
    weights = [_weight(*parts) for parts in zip(columns, left, rows.use.T, strict=True)]
    weighted = np.array(weights)[:, None] * rows.use.T
    return columns * weighted[:, :, None], left * weighted


def _triangle(columns: Array, y: Array, count: float) -> tuple[Array, Array]:
    """R and z: ‖R x - z‖² is the sum of squares, with ``count`` independent values per row."""
    both = np.column_stack([columns.reshape(-1, columns.shape[2]), y.ravel()])
    R = np.linalg.qr(np.sqrt(count) * both, mode="r")
    return R[:, :-1], R[:, -1]


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
    G = np.block(
        [[place.rotation, place.translation[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]]
    )
    return np.column_stack([bodies.numbers_of(G @ basis @ G.T) for basis in bodies.BASIS])


def _ball() -> Array:
    J = np.diag([GUESS**2 / 5.0] * 3 + [1.0])
    return bodies.numbers_of(J)


def _weight(columns: Array, left: Array, use: Any) -> float:
    """Inverse of the part of a joint's torque that no payload explains."""
    if not use.any():
        return 0.0
    x = np.linalg.lstsq(columns[use], left[use], rcond=1e-10)[0]
    rest = float(np.sqrt(np.mean((left[use] - columns[use] @ x) ** 2)))
    return 1.0 / max(rest, NOISELESS * float(np.sqrt(np.mean(left[use] ** 2))), 1e-12)
