# SPDX-License-Identifier: Apache-2.0
"""A payload alone: the body in the hand of an arm that is known."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, did_you_mean, known_names
from arm_dynamics.identification import checks
from arm_dynamics.identification.data import records_of
from arm_dynamics.identification.described import central_inertia
from arm_dynamics.identification.names import mapped
from arm_dynamics.identification.preparation import prepare
from arm_dynamics.identification.regression import bodies
from arm_dynamics.identification.regression.estimation import (
    NOISELESS,
    belief_of,
    made_possible,
    solved,
)
from arm_dynamics.identification.regression.regressor import RigidRegressor
from arm_dynamics.identification.regression.rows import Rows, steady_friction
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.scene.load import load_scene
from arm_dynamics.scene.schema import Payload

GUESS = 0.1
"""Radius in [m] of the ball of 1 kg that a payload is believed to be near, loosely."""
LOOSE = 10.0


def identify_payload(
    scene: Any, recordings: Any, frame: str, *, band: float | None = None,
    names: Mapping[str, str] | None = None,
) -> Payload:  # fmt: skip
    """Find the body that an arm carries, whose own bodies and friction are known.

    Args:
        scene: The arm without it, anything ``load_scene`` takes.
        recordings: Of the arm with it; see ``identify``.
        frame: That carries it, and in which it is told.
        band: Cut-off frequency of the low-pass in [Hz]; None for the one that fits the noise.
        names: What the recordings call the scene's joints, where that cannot be guessed.

    Returns:
        The payload, for ``payloads`` of a scene; a body that there can be.

    Raises:
        SceneError: If the scene cannot be used.
        InvalidInput: If the frame is unknown or fixed, or nothing is to be learnt.
    """
    model = ArmModel(load_scene(scene))
    checks.check_model(model)
    place, carrier = _carried(model, frame)
    records = [mapped(r, model.joint_names, names) for r in records_of(recordings)]
    for record in records:
        checks.check_record(record, model)
    motions = [prepare(record, band) for record in records]
    checks.moved(motions)
    rows = Rows(RigidRegressor(model), motions, held_out=0.0)
    checks.check_rows(rows, model.joint_names)
    known = rows.rigid @ rows.regressor.nominal + rows.known + rows.inertia * model.armature
    left = rows.effort - known - steady_friction(rows, known)
    columns = rows.rigid[:, :, rows.regressor.places(carrier)] @ _moved(place)
    weights = [_weight(columns[:, j], left[:, j], rows.use[:, j]) for j in range(rows.n)]
    A = np.concatenate([w * columns[rows.use[:, j], j] for j, w in enumerate(weights)])
    b = np.concatenate([w * left[rows.use[:, j], j] for j, w in enumerate(weights)])
    R = np.linalg.qr(np.sqrt(rows.independent) * np.column_stack([A, b]), mode="r")
    belief = belief_of(_ball(), 10, LOOSE, LOOSE)
    T, z = belief.combined(R[:, :-1], R[:, -1])
    x = solved(T, z)
    if not bodies.possible(x, 1e-9):
        x = made_possible(T, z, _ball(), _ball(), ())
    mass, com, inertia = central_inertia(x)
    six = inertia[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    return Payload(frame=frame, mass=mass, com=tuple(com.tolist()), inertia=tuple(six.tolist()))


def _carried(model: ArmModel, frame: str) -> tuple[pin.SE3, int]:
    """Where a frame is in the body that carries it, and which one that is."""
    if frame not in model.frame_names:
        raise InvalidInput(
            f"frame is '{frame}'{did_you_mean(frame, model.frame_names)}; the arm has "
            f"{known_names(model.frame_names)}"
        )
    found = model.pin.frames[model.pin.getFrameId(frame)]
    if found.parentJoint == 0:
        raise InvalidInput(f"frame is '{frame}', which no joint moves")
    return found.placement, found.parentJoint - 1


def _moved(place: pin.SE3) -> Array:
    """Ten numbers about the body's joint from those about a frame in it, shape (10, 10)."""
    G = np.block(
        [[place.rotation, place.translation[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]]
    )
    return np.column_stack([bodies.numbers_of(G @ basis @ G.T) for basis in bodies.BASIS])


def _ball() -> Array:
    J = np.diag([GUESS**2 / 5.0] * 3 + [1.0])
    return bodies.numbers_of(J)


def _weight(columns: Array, left: Array, use: Any) -> float:
    """1 over what a joint's torque has that no payload makes."""
    if not use.any():
        return 0.0
    x = np.linalg.lstsq(columns[use], left[use], rcond=1e-10)[0]
    rest = float(np.sqrt(np.mean((left[use] - columns[use] @ x) ** 2)))
    return 1.0 / max(rest, NOISELESS * float(np.sqrt(np.mean(left[use] ** 2))), 1e-12)
