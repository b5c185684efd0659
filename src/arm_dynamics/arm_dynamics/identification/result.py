# SPDX-License-Identifier: Apache-2.0
"""What an identification found, how sure it is, and what it did not find."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.identification.regression.friction_columns import JointFit
from arm_dynamics.scene.schema import Scene


@dataclass(frozen=True)
class Torques:
    """Measured and predicted torques at the times that were computed with; NaN where not used.

    Attributes:
        time: In [s], shape (k,).
        measured: Low-passed efforts in [N m] or [N], shape (k, n).
        predicted: By what was identified, on the part held out by what was identified without it.
        nominal: By the nominal scene.
        v: Velocities, shape (k, n).
        friction: Measured torques less those of bodies and drives, shape (k, n).
        held_out: Rows that are held out, shape (k,).
    """

    time: Array
    measured: Array
    predicted: Array
    nominal: Array
    v: Array
    friction: Array
    held_out: NDArray[np.bool_]


@dataclass(frozen=True)
class Identification:
    """A scene from measured motions.

    Attributes:
        scene: The nominal scene with what was found in it; it loads and simulates.
        joint_names: Of the scene.
        parameters: What the motions show, by name: base parameters (groups of numbers of bodies
            and armatures, such as ``elbow.Izz + elbow.armature``), and of each joint
            ``NAME.viscous``, ``NAME.coulomb`` and so on, in SI units.
        intervals: 95 % intervals of them.
        nominal: What the nominal scene says of base parameters.
        missing: What was not found, and why, by name.
        torque_error: Of each joint: root mean square of what the prediction leaves of the torque,
            over that of the torque, on the part held out.
        nominal_error: The same of the nominal scene.
        error: Of all joints together: of the prediction, and of the nominal scene.
        torque_residual: What is left of each joint in [N m] or [N].
        friction: Of each joint; None where it stays as it is in the nominal scene.
        bodies: Ten numbers of each moving body, shape (bodies, 10).
        body_names: Their names.
        scales: Torque per unit of effort of each joint, 1 where efforts are torques, shape (n,).
        band: Cut-off frequency of the low-pass in [Hz].
        effort_band: That of predictions in [Hz], where efforts show nothing of the motion above;
            None where it is the same.
        condition: Condition number of the scaled regression.
        notes: What was odd, and what was done about it.
        torques: For figures.
    """

    scene: Scene
    joint_names: tuple[str, ...]
    parameters: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]
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
