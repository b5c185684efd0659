# SPDX-License-Identifier: Apache-2.0
"""Keys of a joint's friction in a scene.

Combinations of keys are checked after the joint's own entry has been merged with that of ``"*"``
and with the URDF's: see ``model.friction.source``.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from arm_dynamics.exceptions import SceneError
from arm_dynamics.scene.types import Finite, NonNegative, Part, Positive, check_curve


class Sides(Part):
    """A coefficient for each direction of motion.

    Attributes:
        positive: Coefficient while the joint moves, or is about to move, in its positive
            direction.
        negative: Coefficient in the negative direction.
    """

    positive: NonNegative
    negative: NonNegative


# One number for both directions, or one for each
Sided = Annotated[
    Annotated[NonNegative, Tag("number")] | Annotated[Sides, Tag("sides")],
    Discriminator(lambda value: "sides" if isinstance(value, dict | Sides) else "number"),
]

# Items that pydantic adds to the location of an error in a ``Sided`` or a ``SpeedTable``
KINDS = ("number", "sides", "row", "rows")


class Table(Part):
    """A tabulated factor of dry friction.

    The table is interpolated by monotone cubics (Fritsch, Butland, SIAM J. Sci. Stat. Comput.
    5(2), 1984), with zero slope at the first and last point and constant beyond them.

    Attributes:
        at: Abscissas, increasing: the joint's position in [rad] or [m], or the load in [N m] or
            [N].
        factor: The factor at each of these points.
        period: Length after which the table repeats, in the unit of ``at``; if absent it does not.
    """

    at: tuple[Finite, ...] = Field(min_length=2)
    factor: tuple[Positive, ...] = Field(min_length=2)
    period: Positive | None = None

    @model_validator(mode="after")
    def _check_curve(self) -> Table:
        check_curve("at", self.at, factor=self.factor)
        if self.period is not None and self.period <= self.at[-1] - self.at[0]:
            raise ValueError(f"period = {self.period}: longer than the table is expected")
        return self


def _rows_or_row(value: object) -> str:
    several = isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple)
    return "rows" if several else "row"


Row = Annotated[tuple[NonNegative, ...], Field(min_length=2)]


class SpeedTable(Part):
    """All friction of a joint by its speed, in place of coefficients.

    What friction is at speed zero is its dry part, which holds the joint at rest and changes sign
    with the direction. Between speeds it is a monotone cubic (see ``Table``), beyond the last it
    goes on with the last slope if it rises there, else it is constant. Between positions, rows are
    blended by smooth steps, with zero slope at each row.

    Attributes:
        speed: Speeds in [rad/s] or [m/s], increasing, one of them 0. A table that begins there
            applies to both directions.
        torque: Size of friction at each speed in [N m] or [N], whatever the direction: it opposes
            the motion, hence at least 0. With ``position``, one row for each.
        position: Positions of the rows in [rad] or [m], increasing; constant beyond them.
        period: Position after which the rows repeat; if absent they do not.
    """

    speed: tuple[Finite, ...] = Field(min_length=2)
    torque: Annotated[
        Annotated[Row, Tag("row")] | Annotated[tuple[Row, ...], Tag("rows")],
        Discriminator(_rows_or_row),
    ]
    position: tuple[Finite, ...] | None = Field(default=None, min_length=2)
    period: Positive | None = None

    @property
    def rows(self) -> tuple[Row, ...]:
        """Torques by speed, one row for each position, or the only one."""
        return self.torque if isinstance(self.torque[0], tuple) else (self.torque,)

    @model_validator(mode="after")
    def _check_speeds(self) -> SpeedTable:
        check_curve("speed", self.speed)
        if 0.0 not in self.speed or self.speed[-1] == 0.0:
            raise ValueError(
                f"speed = {self.speed}: 0 is expected among them, with speeds above it; friction "
                "there is the dry friction, 0 if there is none"
            )
        return self

    @model_validator(mode="after")
    def _check_positions(self) -> SpeedTable:
        rows, places = self.rows, len(self.position or (0.0,))
        if len(rows) != places:
            raise ValueError(
                f"positions = {places}, rows of 'torque' = {len(rows)}; one for each is expected"
            )
        for row in rows:
            check_curve("speed", self.speed, torque=row)
        still = [row[self.speed.index(0.0)] for row in rows]
        if min(still) == 0.0 < max(still):
            raise ValueError(
                f"torque at speed 0 = {still}: more than 0 at every position, or 0 at all, is "
                "expected"
            )
        if self.position is None:
            if self.period is not None:
                raise ValueError(f"period = {self.period}: 'position' is missing, which repeats")
            return self
        check_curve("position", self.position)
        if self.period is not None and self.period <= self.position[-1] - self.position[0]:
            raise ValueError(f"period = {self.period}: longer than 'position' is expected")
        return self


def _check_sizes(table: Table) -> Table:
    if table.at[0] < 0.0:
        raise ValueError(
            f"at = {table.at[0]:g} is never reached, since the size of the load counts; points "
            "of at least 0 are expected"
        )
    return table


class Lugre(Part):
    """LuGre model of the dry friction of a joint, in place of stick-slip events.

    Attributes:
        sigma0: Stiffness of the bristles in [N m/rad] or [N/m].
        sigma1: Damping of the bristles in [N m s/rad] or [N s/m]; only passive sets of parameters
            are allowed.
        sigma1_velocity: Speed in [rad/s] or [m/s] at which that damping has faded to 37 %; without
            it, it does not fade.
    """

    sigma0: Positive
    sigma1: NonNegative = 0.0
    sigma1_velocity: Positive | None = None


class Friction(Part):
    """Friction of one joint; by default that of the URDF's ``<dynamics>``.

    Attributes:
        viscous: Torque per speed in [N m s/rad] or [N s/m]; one number, or one for each direction.
        coulomb: Dry friction of a sliding joint in [N m] or [N], likewise.
        static: Largest dry friction of a joint at rest in [N m] or [N], likewise; below
            ``coulomb`` only with ``stribeck_velocity``: friction then rises with speed.
        stribeck_velocity: Speed in [rad/s] or [m/s] at which friction has gone 63 % of the way
            from ``static`` to ``coulomb``; without it, friction falls at once.
        position: Factor of the dry friction over the position of the joint.
        load: Factor of the dry friction over the size of the drive's torque at the joint.
        lugre: LuGre model in place of stick-slip events; requires ``coulomb``, and
            ``stribeck_velocity`` where ``static`` is larger.
        table: Friction by speed, and by position, in place of the coefficients above but
            ``viscous``, which is added to it, and of the URDF's.
    """

    viscous: Sided | None = None
    coulomb: Sided | None = None
    static: Sided | None = None
    stribeck_velocity: Positive | None = None
    position: Table | None = None
    load: Annotated[Table, AfterValidator(_check_sizes)] | None = None
    lugre: Lugre | None = None
    table: SpeedTable | None = None

    @property
    def stateful(self) -> str | None:
        """Key of the friction model with states that includes dry friction; None if none does."""
        return next((key for key in STATEFUL if getattr(self, key) is not None), None)


# Keys of a joint's friction that select a model with internal states
STATEFUL = ("lugre",)

# Keys of a joint's friction that a table replaces
IN_TABLE = ("coulomb", "static", "stribeck_velocity", "position", "load", *STATEFUL)


def refusal(joint: str, text: str) -> SceneError:
    """The error for a joint's friction; ``text`` begins with the key and a '."""
    return SceneError(f"scene: 'joints.{joint}.friction.{text}")
