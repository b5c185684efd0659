# SPDX-License-Identifier: Apache-2.0
"""Quantities that a scene declares tunable, as one vector p."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import get_args

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm_dynamics import ArmModel, InvalidInput, SceneError
from arm_dynamics.arrays import Array, vector_or_batch
from arm_dynamics.attributes import frozen
from arm_dynamics.scene import Scene
from arm_dynamics.scene.constraint import switches
from arm_dynamics.scene.inertia import fault, possible
from arm_dynamics.scene.schema import Tunable

EXTERNAL, CONSTRAINTS = "external", "constraints"
# Smallest mass, centre of mass, and ixx, ixy, ixz, iyy, iyz, izz of a body
_BODY_LOWER_BOUNDS = [0.0, *[-np.inf] * 3, 0.0, *[-np.inf] * 2, 0.0, -np.inf, 0.0]


@frozen
class Parameter:
    """A quantity that the scene declares tunable.

    Attributes:
        name: ``gravity``, ``payload``, ``friction``, ``coulomb``, ``external`` or
            ``constraints``.
        nominal: Its value in the scene: gravity, shape (3,); mass, com (3) and inertia (6) of
            each payload; viscous coefficients, shape (n,); dry friction in sliding, shape (n,),
            with which that at rest changes in proportion; external joint torques, not subject to
            effort limits, shape (n,); or 1 and 0 for switchable constraints that are active and
            inactive.
        least: Smallest allowed values, of the same shape; those of payloads are necessary, not
            sufficient.
        most: Largest allowed values, of the same shape.
    """

    name: str
    nominal: Array
    least: Array
    most: Array

    @classmethod
    def of(
        cls, name: str, nominal: Array, least: ArrayLike = -np.inf, most: ArrayLike = np.inf
    ) -> Parameter:
        """A quantity whose bounds are numbers or arrays."""
        bounds = (np.array(np.broadcast_to(bound, nominal.shape)) for bound in (least, most))
        return cls(name, nominal, *bounds)


def names_of(scene: Scene) -> tuple[str, ...]:
    """Names of a scene's tunable quantities in the order of p, with those of switches last."""
    names = (name for name in get_args(Tunable) if name in scene.tunable)
    return (*names, *([CONSTRAINTS] if switches(scene.constraints).size else []))


def insert_external(p: Array, scene: Scene, n: int) -> Array:
    """The vector p with external torques of zero on n joints, which a scene does not declare."""
    return np.insert(p, len(p) - switches(scene.constraints).size, np.zeros(n))


def remove_external(p: Array, scene: Scene, n: int) -> Array:
    """The vector p without the external torques on n joints."""
    end = len(p) - switches(scene.constraints).size
    return np.delete(p, np.s_[end - n : end])


class Parameters:
    """All tunable quantities of a scene, in the order of the vector p.

    Attributes:
        items: The quantities.
    """

    def __init__(self, model: ArmModel) -> None:
        payloads = [[load.mass, *load.com, *load.inertia] for load in model.scene.payloads]
        bodies, friction = np.array(payloads, dtype=float).ravel(), model.friction
        dry = friction.coulomb.mean
        quantities = (
            Parameter.of("gravity", np.array(model.scene.gravity)),
            Parameter.of("payload", bodies, np.tile(_BODY_LOWER_BOUNDS, len(payloads))),
            Parameter.of("friction", model.viscous, abs(friction.viscous.skew)),
            Parameter.of("coulomb", dry, 0.0, np.where(dry > 0.0, np.inf, 0.0)),
            Parameter.of(EXTERNAL, np.zeros(model.n)),
            Parameter.of(CONSTRAINTS, switches(model.scene.constraints)),
        )
        by_name = {item.name: item for item in quantities}
        self._joints = model.joint_names
        self.items = tuple(by_name[name] for name in names_of(model.scene))
        ends = np.cumsum([item.nominal.size for item in self.items]).tolist()
        self._places = dict(zip(self.names, map(slice, [0, *ends], ends), strict=True))
        if "coulomb" in self.names and not dry.any():
            raise SceneError(
                "scene: 'tunable': 'coulomb' is tunable, but no joint has dry friction without "
                "states; a joint with 'friction.coulomb' is expected"
            )

    @property
    def names(self) -> list[str]:
        """Names of the tunable quantities."""
        return [item.name for item in self.items]

    @property
    def nominal(self) -> Array:
        """The vector p of nominal values, shape (np,)."""
        return np.concatenate([np.zeros(0), *(item.nominal for item in self.items)])

    def of(self, name: str, p: Array) -> Array:
        """Values of one quantity in ``p``, shape (size,); empty if it is not tunable."""
        place = self.place(name)
        return np.zeros(0) if place is None else p[place]

    def place(self, name: str) -> slice | None:
        """Slice of one quantity in p; None if it is not tunable."""
        return self._places.get(name)

    def places(self, names: Sequence[str]) -> dict[str, tuple[int, ...]]:
        """Indices in p of the quantities to differentiate by, in the order of their names.

        Raises:
            InvalidInput: If a name is not tunable, or denotes switches.
        """
        allowed = [name for name in self.names if name != CONSTRAINTS]
        indices = dict[str, tuple[int, ...]]()
        for name in names:
            if name not in allowed or (place := self.place(name)) is None:
                raise InvalidInput(
                    f"by = {list(names)}: there is no derivative by '{name}'; the scene's "
                    f"'tunable' allows {allowed or 'nothing'}"
                )
            indices[name] = tuple(range(place.start, place.stop))
        return indices

    def symbols(self) -> dict[str, ca.SX]:
        """One symbol for each quantity, in the order of p."""
        return {item.name: ca.SX.sym(item.name, item.nominal.size) for item in self.items}

    def merged(self, values: Mapping[str, ArrayLike], p: Array) -> Array:
        """The vector p with some quantities replaced.

        Args:
            values: New values by name; each of the nominal size, or a row of that size for each of
                b arms.
            p: Values of the others, shape (np,).

        Returns:
            Shape (np,), or (b, np) if a value has rows.

        Raises:
            InvalidInput: If a name is not tunable, a size or number is not allowed, a payload is
                not physically consistent, or friction is negative or of a joint without.
        """
        if not values:
            return p.copy()
        for name in values:
            if name not in self.names:
                listed = self.names or f"none of {', '.join(get_args(Tunable))}"
                raise InvalidInput(f"'{name}' is not tunable; 'tunable' lists {listed}")
        columns = [
            self._check(item, values[item.name]) if item.name in values else self.of(item.name, p)
            for item in self.items
        ]
        shape = np.broadcast_shapes(*(column.shape[:-1] for column in columns))
        full = [np.broadcast_to(column, (*shape, column.shape[-1])) for column in columns]
        return np.concatenate([np.zeros((*shape, 0)), *full], axis=-1)

    def _check(self, item: Parameter, value: ArrayLike) -> Array:
        """Values of a quantity as an array, refused if they are not allowed."""
        values = vector_or_batch(item.name, np.atleast_1d(value), item.nominal.size)
        match item.name:
            case "friction" | "coulomb":
                _check_bounds(item, values, self._joints)
            case "payload":
                _check_payloads(values)
            case "constraints":
                _check_switches(values)
        return values


def _check_bounds(item: Parameter, values: Array, joints: Sequence[str]) -> None:
    """Refuse the first value of joints, of shape (…, n), that is not within the bounds."""
    for place in np.argwhere((values < item.least) | (values > item.most))[:1]:
        i = int(place[-1])
        expected, why = f"at least {item.least[i]:g}", ""
        if item.least[i]:
            why = " (half the difference of its two directions)"
        elif item.most[i] == 0.0:
            expected, why = "0", ", since it has no dry friction in the scene,"
        raise InvalidInput(
            f"{item.name}[{i}]{_of_arm(place)} = {values[tuple(place)]:g} at joint '{joints[i]}'; "
            f"{expected}{why} is expected"
        )


def _check_payloads(values: Array) -> None:
    """Reject inertias that are not physically consistent; values of shape (…, 10 per payload)."""
    loads = values.reshape(*values.shape[:-1], -1, 10)
    bad = np.argwhere(~possible(loads[..., 0], loads[..., 4:]))
    if len(bad):
        load = loads[tuple(bad[0])]
        raise InvalidInput(f"payload {bad[0][-1]}{_of_arm(bad[0])}: {fault(load[0], load[4:])}")


def _check_switches(values: Array) -> None:
    bad = np.argwhere((values != 0.0) & (values != 1.0))
    if len(bad):
        raise InvalidInput(
            f"constraints[{bad[0][-1]}]{_of_arm(bad[0])} = {values[tuple(bad[0])]:g}; "
            "allowed: 1 (holds) and 0 (does not)"
        )


def _of_arm(place: NDArray[np.intp]) -> str:
    """The index of the arm in a batch, for a message."""
    return f" of arm {place[0]}" if len(place) > 1 else ""
