# SPDX-License-Identifier: Apache-2.0
"""Result of an identification: a record of each joint and of each parameter, with its interval."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.exceptions import known_names
from arm_dynamics.scene.schema import Scene
from arm_studies.identification.regression.friction import JointFit
from arm_studies.identification.regression.uncertainty import Estimate
from arm_studies.identification.validation import Errors


@frozen
class IdentifiedJoint:
    """What was identified of a joint, and how well its torque is predicted.

    Attributes:
        name: Its name.
        friction: None if it is unchanged from the nominal scene.
        scale: Torque per unit of effort, 1 if efforts are torques.
        errors: Residual over torque, root mean squares on held-out data; NaN for a joint that is
            at rest in most of them.
        residual: Root mean square residual in [N m] or [N]; NaN likewise.
    """

    name: str
    friction: JointFit | None
    scale: float
    errors: Errors
    residual: float


@frozen
class IdentifiedParameter:
    """What the torques say of a parameter, and its value in the scenes, in SI units.

    Attributes:
        estimate: By least squares, drawn neither to the nominal bodies nor to physically
            consistent ones; None if the torques do not determine it.
        written: Value in the identified scene, whose bodies are physically consistent, and near
            the nominal ones where the torques determine little; None if the scene has none.
        nominal: Value in the nominal scene, of base parameters; else None.
        missing: Why it was not identified; empty if it was.
    """

    estimate: Estimate | None
    written: float | None = None
    nominal: float | None = None
    missing: str = ""


@frozen
class Torques:
    """Measured and predicted torques at the times of the regression; NaN where not used.

    Attributes:
        time: In [s], shape (k,).
        measured: Low-pass filtered efforts in [N m] or [N], shape (k, n).
        predicted: By the identified model, shape (k, n); on held-out rows by the model identified
            without them; NaN also where a joint may stick, since no law determines its friction.
        nominal: By the nominal scene, likewise.
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
        joints: In the order of the scene.
        details: Base parameters (combinations of inertial parameters and armatures, such as
            ``elbow.Izz + elbow.armature``), and of each joint ``NAME.viscous``, ``NAME.coulomb``
            and so on.
        bodies: Ten inertial parameters of each moving body, shape (bodies, 10).
        body_names: Names of the bodies.
        error: Relative residual of all joints together on held-out data; NaN if it is unknown.
        band: Cut-off frequency of the low-pass filter in [Hz].
        effort_band: Cut-off frequency of predictions in [Hz], if efforts contain less of the
            motion than ``band``; else None.
        condition: Condition number of the scaled regression.
        notes: Irregularities of the data, and how they were handled.
        torques: For figures.
    """

    scene: Scene
    joints: tuple[IdentifiedJoint, ...]
    details: Mapping[str, IdentifiedParameter]
    bodies: Array
    body_names: tuple[str, ...]
    error: Errors
    band: float
    effort_band: float | None
    condition: float
    notes: tuple[str, ...]
    torques: Torques

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints of the scene."""
        return tuple(joint.name for joint in self.joints)

    @property
    def _estimates(self) -> dict[str, Estimate]:
        return {name: p.estimate for name, p in self.details.items() if p.estimate is not None}

    @property
    def parameters(self) -> dict[str, float]:
        """Values that the torques determine, by name."""
        return {name: each.value for name, each in self._estimates.items()}

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % confidence intervals of ``parameters``, but for ``scatter``."""
        return {name: (each.low, each.high) for name, each in self._estimates.items()}

    @property
    def scatter(self) -> frozenset[str]:
        """Parameters whose interval is no 95 % interval.

        Errors of the model, not noise, cause most of its width: it tells how much they scatter
        along the recording.
        """
        return frozenset(name for name, each in self._estimates.items() if each.scatter)

    @property
    def written(self) -> dict[str, float]:
        """Values in the identified scene, by name."""
        return {name: p.written for name, p in self.details.items() if p.written is not None}

    @property
    def nominal(self) -> dict[str, float]:
        """Base parameters of the nominal scene."""
        return {name: p.nominal for name, p in self.details.items() if p.nominal is not None}

    @property
    def missing(self) -> dict[str, str]:
        """Reasons of what was not identified, also of parameters whose interval contains zero."""
        return {name: each.missing for name, each in self.details.items() if each.missing}

    @property
    def torque_error(self) -> dict[str, float]:
        """Relative residual of each joint on held-out data; NaN if it is unknown."""
        return {joint.name: joint.errors.identified for joint in self.joints}

    @property
    def nominal_error(self) -> dict[str, float]:
        """Relative residual of each joint of the nominal scene; NaN if it is unknown."""
        return {joint.name: joint.errors.nominal for joint in self.joints}

    @property
    def torque_residual(self) -> dict[str, float]:
        """Root mean square residual of each joint in [N m] or [N]; NaN if it is unknown."""
        return {joint.name: joint.residual for joint in self.joints}

    @property
    def friction(self) -> tuple[JointFit | None, ...]:
        """Friction of each joint; None if it is unchanged from the nominal scene."""
        return tuple(joint.friction for joint in self.joints)

    @property
    def scales(self) -> Array:
        """Torque per unit of effort of each joint, 1 if efforts are torques, shape (n,)."""
        return np.array([joint.scale for joint in self.joints])

    def __repr__(self) -> str:
        """A summary: errors, how much is known, and the notes."""
        error, nominal = ("unknown" if np.isnan(x) else f"{x:.2%}" for x in self.error)
        missing = self.missing
        lines = [
            f"<Identification of {len(self.joints)} joints: {known_names(self.joint_names, 8)}",
            f"torque error on held-out data: {error}, of the nominal scene {nominal}",
            f"{len(self.parameters.keys() - missing.keys())} parameters identified, "
            f"{len(missing)} not; low-pass filter {self.band:.3g} Hz; condition number "
            f"{self.condition:.3g}",
            *(f"note: {note}" for note in self.notes),
        ]
        return "\n  ".join(lines) + ">"
