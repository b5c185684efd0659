# SPDX-License-Identifier: Apache-2.0
"""Result of an identification: parameters, their intervals, and what was not identified."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.exceptions import known_names
from arm_dynamics.scene.schema import Scene
from arm_studies.identification.regression.friction import JointFit


@frozen
class Torques:
    """Measured and predicted torques at the times of the regression; NaN where not used.

    Attributes:
        time: In [s], shape (k,).
        measured: Low-pass filtered efforts in [N m] or [N], shape (k, n).
        predicted: By the identified model; on held-out rows by the model identified without them;
            NaN also where a joint may stick, since no law determines its friction.
        nominal: By the nominal scene.
        v: Velocities, shape (k, n).
        friction: Measured torques minus those of bodies and drives, shape (k, n).
        held_out: Rows that are held out, shape (k,).
    """

    time: Array
    measured: Array
    predicted: Array
    nominal: Array
    v: Array
    friction: Array
    held_out: NDArray[np.bool_]


@frozen
class Identification:
    """A scene from measured motions.

    Attributes:
        scene: The nominal scene with the identified parameters; it loads and simulates.
        joint_names: Joints of the scene.
        parameters: Values that the torques determine, by name: base parameters (combinations of
            inertial parameters and armatures, such as ``elbow.Izz + elbow.armature``), and of each
            joint ``NAME.viscous``, ``NAME.coulomb`` and so on, in SI units. They are those of
            least squares, drawn neither to the nominal bodies nor to physically consistent ones.
        intervals: Their 95 % confidence intervals, but for ``scatter``.
        scatter: Parameters whose interval is no 95 % interval, since errors of the model, not
            noise, cause most of its width: it tells how much they scatter along the recording.
        written: The same in the scene, whose bodies are physically consistent, and near the
            nominal ones where the torques determine little.
        nominal: Base parameters of the nominal scene.
        missing: Reasons of what was not identified, by name; also of parameters whose interval
            contains zero.
        torque_error: Root mean square residual of each joint over that of its torque, on held-out
            data; NaN for a joint that is at rest in most of them.
        nominal_error: The same of the nominal scene.
        error: Relative residual of these joints together: of the prediction, of the nominal scene;
            NaN if there are none.
        torque_residual: Root mean square residual of each joint in [N m] or [N]; NaN likewise.
        friction: Of each joint; None if it is unchanged from the nominal scene.
        bodies: Ten inertial parameters of each moving body, shape (bodies, 10).
        body_names: Names of the bodies.
        scales: Torque per unit of effort of each joint, 1 if efforts are torques, shape (n,).
        band: Cut-off frequency of the low-pass filter in [Hz].
        effort_band: Cut-off frequency of predictions in [Hz], if efforts contain less of the
            motion than ``band``; else None.
        condition: Condition number of the scaled regression.
        notes: Irregularities of the data, and how they were handled.
        torques: For figures.
    """

    scene: Scene
    joint_names: tuple[str, ...]
    parameters: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]
    scatter: frozenset[str]
    written: Mapping[str, float]
    nominal: Mapping[str, float]
    missing: Mapping[str, str]
    torque_error: Mapping[str, float]
    nominal_error: Mapping[str, float]
    error: tuple[float, float]
    torque_residual: Mapping[str, float]
    friction: tuple[JointFit | None, ...]
    bodies: Array
    body_names: tuple[str, ...]
    scales: Array
    band: float
    effort_band: float | None
    condition: float
    notes: tuple[str, ...]
    torques: Torques

    def __repr__(self) -> str:
        """A summary: errors, how much is known, and the notes."""
        error, nominal = ("unknown" if np.isnan(x) else f"{x:.2%}" for x in self.error)
        known = len(self.parameters.keys() - self.missing.keys())
        names = known_names(self.joint_names, 8)
        lines = [
            f"<Identification of {len(self.joint_names)} joints: {names}",
            f"torque error on held-out data: {error}, of the nominal scene {nominal}",
            f"{known} parameters identified, {len(self.missing)} not; low-pass filter "
            f"{self.band:.3g} Hz; condition number {self.condition:.3g}",
            *(f"note: {note}" for note in self.notes),
        ]
        return "\n  ".join(lines) + ">"
