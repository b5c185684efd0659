# SPDX-License-Identifier: Apache-2.0
"""Symbols of one scene, and the parts of its equation of motion that all options share."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from arm_dynamics.equations import spring
from arm_dynamics.equations.contact import MODE
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.tree_builder import gravity_of, tree_of
from arm_dynamics.scene.constraint import switchable
from arm_sim.case_modes import Switches, case_modes
from arm_sim.plant.options import SCENE, Options
from arm_sim.plant.parameters import CONSTRAINTS, EXTERNAL, Parameters
from arm_sim.plant.switches import SwitchedDrives


class Symbols:
    """Symbols q, v, tau and p of a scene, and expressions that follow from them alone.

    Attributes:
        q: Joint positions, shape (n,).
        v: Joint velocities, shape (n,).
        tau: Torques of the drives, shape (n,).
        p: Tunable quantities, shape (np,).
        tree: The links, with possibly tunable payloads.
        gravity: Gravity in the world frame in [m/s²], shape (3,).
        friction: Friction of the joints, with possibly tunable dry levels.
        passive: Viscous friction and springs less external torques, shape (n,).
        drives: Drives with modes, or None.
        cords: Case distinctions of cords; None without any, or with comparisons instead.
    """

    cords: Switches | None

    def __init__(
        self, model: ArmModel, parameters: Parameters, drives: SwitchedDrives | None = None
    ) -> None:
        """Take the symbols.

        Args:
            model: The robot.
            parameters: Tunable quantities.
            drives: Drives with modes; None if drives and cords have comparisons instead.
        """
        p = parameters.symbols()
        self.q, self.v, self.tau = (ca.SX.sym(name, model.n) for name in ("q", "v", "tau"))
        self.p = ca.vertcat(ca.SX(0, 1), *p.values())
        self.tree = tree_of(model, ca.vertsplit(p["payload"], 10) if "payload" in p else None)
        self.gravity = p.get("gravity", gravity_of(model))
        self._switches = ca.vertsplit(p[CONSTRAINTS]) if CONSTRAINTS in p else []
        self._switchable = switchable(model.scene.constraints)
        friction = model.friction
        self.friction = friction.scaled(p["coulomb"]) if "coulomb" in p else friction
        if drives and (forward := drives.forward):
            signs = (forward.get(i, self.tau[i] > 0.0) for i in range(model.n))
            self.friction = replace(self.friction, forward=ca.vertcat(*signs))
        self.passive = friction.smooth(self.v, self.q, p.get("friction"))
        self.drives, self.cords = drives, None
        if model.springs:
            torque = spring.torque(model.springs, self.tree, self.q, self.v)
            if drives and has_cords(model):
                self.cords = case_modes([torque], ca.vertcat(self.q, self.v))
                (torque,) = self.cords.results
            self.passive += torque
        if EXTERNAL in p:  # acts where friction does: on the link, behind limits and drives
            self.passive -= p[EXTERNAL]

    @property
    def switches(self) -> ca.SX:
        """Symbols of the modes of cords and drives: 1 where a comparison holds, else 0."""
        kinds = (kind.modes for kind in (self.cords, self.drives) if kind)
        return ca.vertcat(ca.SX(0, 1), *kinds)

    def active(self, place: int) -> ca.SX | float:
        """1 or 0 for the constraint at an index of the scene's list: whether it is active."""
        places = self._switchable
        return 1.0 if place not in places else self._switches[places.index(place)]


class Joints:
    """Modes of joints with dry friction or stops, and of contacts.

    Args:
        model: The robot.
        s: Its symbols.
        options: Options, of which stops, sliding and regularization are used.

    Attributes:
        direction: Symbols: -1 or 1 for sliding, 0 for sticking or being held by a rigid stop;
            empty where no joint can.
        pressed: Symbols: -1 or 1 where a joint presses against its lower or upper compliant stop,
            else 0; empty without such stops.
        sliding: 1 for a joint that slides, 0 for one that is held, shape (n,).
        friction: Dry friction of sliding joints in [N m] or [N], shape (n,).
        stop: Torque of compliant stops on the joints in [N m] or [N], shape (n,).
        pressures: Torques of compliant stops if touched, see ``equations.spring``, shape (2 n,).
        switches: Symbols of the modes of cords and drives, see ``Symbols``.
        contacts: Symbols: the modes of the contacts, see ``equations.contact.Mode``.
        p: The complete vector of tunable quantities and modes.
    """

    def __init__(self, model: ArmModel, s: Symbols, options: Options = SCENE) -> None:
        n, contacts = model.n, len(model.scene.contacts)
        directions, pressed = mode_counts(model, options.stops)
        self.direction = ca.SX.sym("direction", directions)
        self.pressed = ca.SX.sym("pressed", pressed)
        self.contacts = ca.SX.sym("mode", MODE * contacts)
        self.switches = s.switches
        self.p = ca.vertcat(s.p, self.direction, self.pressed, self.switches, self.contacts)
        self.sliding, self.friction, self.stop = ca.SX.ones(n), ca.SX(n, 1), ca.SX(n, 1)
        if directions and not options.sliding:
            rigid = model.stops.rigid.any(axis=0) & options.stops
            can_stick = (model.friction.level > 0.0) | rigid
            slides = (self.direction[i] ** 2 if can_stick[i] else 1 for i in range(n))
            self.sliding = ca.vertcat(*slides)
        if model.has_dry_friction:
            speed = options.regularization
            direction = s.v / ca.sqrt(s.v**2 + speed**2) if speed else self.direction
            self.friction = ca.sparsify(s.friction.dry(s.v, direction, s.q, s.tau))
        if pressed:
            stops = model.stops
            rates = stops.stiffness, stops.damping
            self.pressures = spring.stop_pressures(s.q, s.v, stops.place, *rates)
            lower, upper = ca.vertsplit(self.pressures, n)
            at_lower, at_upper = self.pressed < 0, self.pressed > 0
            self.stop = ca.sparsify(at_lower * lower - at_upper * upper)


@dataclass(frozen=True)
class Layout:
    """Numbers of the entries of p before the modes of the contacts, in their order.

    Attributes:
        tunable: Number of tunable quantities.
        directions: Size of ``Joints.direction``.
        pressed: Size of ``Joints.pressed``.
        switches: Size of ``Symbols.switches``.
    """

    tunable: int
    directions: int
    pressed: int
    switches: int

    def parts(self, p: ca.SX) -> tuple[ca.SX, ...]:
        """Tunable quantities, directions, compliant stops, switches, and contacts, from p."""
        numbers = self.tunable, self.directions, self.pressed, self.switches
        return tuple(ca.vertsplit(p, [*np.cumsum([0, *numbers]).tolist(), p.shape[0]]))


def has_cords(model: ArmModel) -> bool:
    """Whether a spring only pulls."""
    return any(point.tension_only for point in model.springs.points)


def mode_counts(model: ArmModel, stops: bool = True) -> tuple[int, int]:
    """Sizes of ``Joints.direction`` and ``Joints.pressed``."""
    may_stick = model.has_dry_friction or (stops and bool(model.stops.rigid.any()))
    yields = stops and bool(model.stops.compliant.any())
    return model.n if may_stick else 0, model.n if yields else 0


def dense_function(name: str, arguments: list[ca.SX], *results: ca.SX) -> ca.Function:
    """A function with dense results, after common-subexpression elimination."""
    return ca.Function(name, arguments, [ca.densify(result) for result in results], {"cse": True})


def expanded_function(
    name: str, arguments: Sequence[ca.MX], results: Sequence[ca.MX]
) -> ca.Function:
    """A function of scalar operations with dense results."""
    dense = [ca.densify(result) for result in results]
    return ca.Function(name, arguments, dense).expand(name, {"cse": True})


def jacobian_by(expression: ca.MX, p: ca.MX, p_indices: Sequence[int]) -> ca.MX:
    """Derivative by entries of p, at no cost if there are none."""
    if not p_indices:
        return type(expression)(expression.shape[0], 0)
    return ca.jacobian(expression, p)[:, list(p_indices)]
