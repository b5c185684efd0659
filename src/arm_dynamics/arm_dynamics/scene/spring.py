# SPDX-License-Identifier: Apache-2.0
"""Keys of springs: of joints, and between points of two frames."""

from __future__ import annotations

from pydantic import Field, StrictBool, model_validator

from arm_dynamics.scene.constraint import ORIGIN, Pair, check_frames, check_unique
from arm_dynamics.scene.types import Finite, NonNegative, Part, Vector3, check_curve
from arm_dynamics.scene.urdf.description import Urdf


class DeflectionTable(Part):
    """Torque of a joint's spring by its deflection.

    Between the points it is a monotone cubic (see ``friction.Table``), beyond them straight, with
    the slope of the last two. Its energy is the integral, zero where the deflection is.

    Attributes:
        deflection: Position of the joint less ``rest`` in [rad] or [m], increasing.
        torque: Torque in [N m] or [N] that holds the spring there: above 0 it pulls the joint
            back towards lower positions.
    """

    deflection: tuple[Finite, ...] = Field(min_length=2)
    torque: tuple[Finite, ...] = Field(min_length=2)

    @model_validator(mode="after")
    def _check_curve(self) -> DeflectionTable:
        check_curve("deflection", self.deflection, torque=self.torque)
        return self


class JointSpring(Part):
    """A spring and a damper beside a joint, on the side of the link.

    Attributes:
        stiffness: Stiffness in [N m/rad] or [N/m]; required unless there is a ``table``, which
            ``model.springs`` checks once ``"*"`` is merged in. 0 removes that of ``"*"`` from a
            joint.
        table: Torque by deflection, for a spring that is not linear, in place of ``stiffness``.
        rest: Rest position in [rad] or [m].
        damping: Damping in [N m s/rad] or [N s/m].
    """

    stiffness: NonNegative | None = None
    table: DeflectionTable | None = None
    rest: Finite = 0.0
    damping: NonNegative = 0.0

    @model_validator(mode="after")
    def _check_law(self) -> JointSpring:
        if self.stiffness and self.table is not None:
            raise ValueError(
                f"stiffness = {self.stiffness} and a table; one of the two is expected"
            )
        return self


class PointSpring(Part):
    """A massless spring and damper between a point of one frame and one of another.

    Attributes:
        frames: The two frames: links or joints of the URDF, or ``world``.
        points: A point of each frame, in its own axes, in [m].
        stiffness: Stiffness in [N/m].
        rest_length: Rest length in [m]; may be 0.
        damping: Damping along the line in [N s/m].
        force: Additional tension in [N]; negative if it pushes, as in a gas spring.
        tension_only: A cord: it pulls, or hangs slack.
        name: Name in messages; by default ``spring_`` and its place in the list.
    """

    frames: Pair
    points: tuple[Vector3, Vector3] = (ORIGIN, ORIGIN)
    stiffness: NonNegative = 0.0
    rest_length: NonNegative = 0.0
    damping: NonNegative = 0.0
    force: Finite = 0.0
    tension_only: StrictBool = False
    name: str | None = Field(default=None, min_length=1)

    @model_validator(mode="after")
    def _check_effect(self) -> PointSpring:
        if not (self.stiffness or self.damping or self.force):
            raise ValueError("a stiffness, a damping or a force is expected")
        if self.tension_only and not self.stiffness and self.force <= 0.0:
            raise ValueError(
                f"tension_only with stiffness = 0 and force = {self.force:g} is never taut; "
                "a stiffness or a force above zero is expected"
            )
        return self


def spring_name(spring: PointSpring, place: int) -> str:
    """Name of a spring; without one, ``spring`` and its index in the scene's list."""
    return spring.name or f"spring_{place}"


def check_springs(springs: tuple[PointSpring, ...], urdf: Urdf) -> None:
    """Check that frames of springs exist and that names of springs differ."""
    names = [spring_name(spring, i) for i, spring in enumerate(springs)]
    for i, spring in enumerate(springs):
        check_unique("springs", names, i)
        check_frames(f"springs.{i}.frames", spring.frames, urdf)
