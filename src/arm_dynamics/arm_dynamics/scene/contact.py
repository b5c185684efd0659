# SPDX-License-Identifier: Apache-2.0
"""Contacts of a scene: points of the arm that may touch a plane, and never go through it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from arm_dynamics.exceptions import SceneError, known_names
from arm_dynamics.scene.types import Direction, Finite, NonNegative, Part, Vector3
from arm_dynamics.scene.urdf import Urdf

Fraction = Annotated[Finite, Field(ge=0.0, le=1.0)]


class Plane(Part):
    """A plane of the world; the arm is on the side to which the normal points.

    Attributes:
        point: Any point of it, in the world frame, in [m].
        normal: Its direction in the world frame; any length but zero.
    """

    point: Vector3 = (0.0, 0.0, 0.0)
    normal: Direction = (0.0, 0.0, 1.0)


class Contact(Part):
    """A point of the arm that a plane stops (unilateral), with Coulomb friction and restitution.

    Attributes:
        frame: Link or joint frame of the URDF that carries the point.
        point: Where it is in that frame in [m].
        plane: What it may touch.
        friction: Coulomb's coefficient µ: tangential force at most µ times the normal one.
        restitution: Newton's coefficient e: speed of rebound over speed of approach, 0 to 1.
        name: What messages call it; by default type and place in the list.
    """

    type: Literal["contact"]
    frame: str
    point: Vector3 = (0.0, 0.0, 0.0)
    plane: Plane = Plane()
    friction: NonNegative = 0.0
    restitution: Fraction = 0.0
    name: str | None = Field(default=None, min_length=1)


def check_contact(key: str, contact: Contact, urdf: Urdf) -> None:
    """Refuse a frame that the robot does not have.

    Args:
        key: Where it stands in the scene.
        contact: The contact.
        urdf: The robot.

    Raises:
        SceneError: With what is allowed.
    """
    if contact.frame not in urdf.frames:
        raise SceneError(
            f"scene: '{key}' = '{contact.frame}' does not exist; "
            f"allowed: {known_names(urdf.frames)}"
        )
