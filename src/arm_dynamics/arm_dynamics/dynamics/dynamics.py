# SPDX-License-Identifier: Apache-2.0
"""Dynamics computed by Pinocchio: the reference for everything else in the suite."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Iterable
from copy import copy
from enum import IntFlag
from functools import cached_property, partial
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.actuation.command_map import CommandMap
from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array, each, finite_answer, vectors
from arm_dynamics.attributes import sealed
from arm_dynamics.codegen.python_call import PythonCall
from arm_dynamics.dynamics.at_rest import AtRest, Points
from arm_dynamics.dynamics.built import arm_model
from arm_dynamics.dynamics.constrained import Constrained, contact_torque
from arm_dynamics.dynamics.one_state import OneState, one_state, unanswered
from arm_dynamics.dynamics.rigid import MANY, RigidDynamics
from arm_dynamics.exceptions import InvalidInput, degrees_meant
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.regularity import MASSLESS, check_regular, some_positions
from arm_dynamics.scene.load import SceneSource


class Term(IntFlag):
    """Terms of the equation of motion τ = M q̈ + C q̇ + G + S + F, for inverse dynamics to add up.

    ``SPRING``, S, is the torque of springs and their dampers.
    """

    INERTIA = 1
    CORIOLIS = 2
    GRAVITY = 4
    FRICTION = 8
    SPRING = 16
    ALL = 31


_log = logging.getLogger(__name__)
_BITS = tuple(int(term) for term in Term)
_WEIGHTLESS = np.zeros(3)
LOOKS = 100
"""Calls whose angles are looked at: a person makes few, a loop many."""


@sealed
class Dynamics:
    """Inverse and forward dynamics of one scene; keep one instance per thread.

    Every method takes vectors of shape (n,) or batches of shape (k, n) in the order of
    ``joint_names`` and returns results of the same kind; ``InvalidInput`` is raised where they
    overflow. Source of the algorithms: Featherstone,
    Rigid Body Dynamics Algorithms, 2008, as implemented by Pinocchio.

    Args:
        scene: A scene, anything ``load_scene`` accepts, or an existing arm model.

    Attributes:
        model: The arm.
        steady_friction: Its steady-state friction F.
        command_map: Converts torques to commands of the drives.
    """

    _instead = {
        "damping friction viscous coulomb": "build another Dynamics, of a scene with "
        "joints: {'*': {friction: {viscous: …}}}",
        "mass masses inertia payload payloads": "build another Dynamics, of a scene with "
        "payloads: [{frame: …, mass: …}] or links: {NAME: {mass: …}}",
        "q v a tau state external": "its methods take them: inverse(q, v, a), forward(q, v, tau), "
        "under(external)",
    }

    def __init__(self, scene: SceneSource | ArmModel) -> None:
        self.model = arm_model(scene)
        self.steady_friction = SteadyFriction.of(self.model)
        self.command_map = CommandMap(self.model)
        self._rigid = RigidDynamics(self.model)
        self._at_rest = AtRest(self.steady_friction)
        self._gravity = np.array(self.model.scene.gravity)
        self._external = np.zeros(self.n)
        self._active: Collection[str] | None = None
        self._regular = False  # checked when accelerations are first requested
        self._silent = not self.model.massless  # said when torques are first requested
        self._turning, self._looks = np.array(self.model.joint_types) != "prismatic", LOOKS
        self._one = OneState()

    @property
    def n(self) -> int:
        """Degrees of freedom."""
        return self.model.n

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Order of every vector."""
        return self.model.joint_names

    def under(self, external: ArrayLike, active: Collection[str] | None = None) -> Self:
        """The same arm under external joint torques and with other constraints active.

        The torques enter forward dynamics, and inverse dynamics with all terms; they act on the
        links, behind limits and drives. For the same thread as this object.

        Args:
            external: External joint torques in [N m] or [N], shape (n,).
            active: Names of the active constraints; None for the initially active ones.

        Raises:
            InvalidInput: If a shape or a value is not allowed.
        """
        other = copy(self)
        (other._external,), other._active = vectors(self.joint_names, external=external), active
        other._one = self._one.of_the_arm_alone()
        return other

    def of_motions(self) -> Self:
        """The same, for computed states, in which many turns do not mean degrees."""
        other = copy(self)
        other._looks = 0
        return other

    def compiled(self, frames: str | Iterable[str] = ()) -> Self:
        """The same arm, with answers for one state by compiled code, without conversions.

        They take less time than those of Pinocchio called directly, friction included, for arrays
        of float of shape (n,); others are converted first. The object is made in half a second,
        with code that is compiled once, in a second more, and verified against Pinocchio. Numbers
        may differ from those of this object in the last digits. What requires decisions (joints
        at rest with dry friction, bilateral constraints in ``forward``, friction that depends on
        the load), external torques, some of the terms, and other frames are left to Pinocchio.
        For the same thread as this object.

        Args:
            frames: Frames whose poses and Jacobians are compiled, too.

        Raises:
            InvalidInput: If a frame is unknown.
            ModelError: If a joint moves no mass.
            KernelError: If there is no compiler, or no header of Python, or code differs from
                Pinocchio.

        Example:
            >>> dynamics = Dynamics("panda").compiled(frames="panda_hand")
        """
        other = copy(self)
        names = (frames,) if isinstance(frames, str) else tuple(frames)
        made = one_state(Dynamics(self.model), self.steady_friction, names)
        alone = self._active is None and not self._external.any()
        other._one = made if alone else made.of_the_arm_alone()
        return other

    def _by_code(
        self, call: PythonCall, otherwise: Callable[..., Array], **given: ArrayLike
    ) -> Array:
        """Compiled answers of vectors or of each row of a small batch, else Pinocchio's."""
        checked = vectors(self.joint_names, **given)
        if self._looks:
            self._look_at_angles(checked[0])
        if call is unanswered or (checked[0].ndim == 2 and len(checked[0]) >= MANY):
            return finite_answer(otherwise(*checked))

        def one(*state: Array) -> Array:
            found = call(*state)
            return finite_answer(otherwise(*state)) if found is None else found

        return each(one, *map(np.ascontiguousarray, checked))

    def _look_at_angles(self, q: Array) -> None:
        """Warn once of angles that are probably degrees."""
        self._looks -= 1
        if remark := degrees_meant(float(np.max(abs(q) * self._turning, initial=0.0))):
            self._looks = 0
            _log.warning("position %s", remark)

    def inverse(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, terms: Term | int = Term.ALL
    ) -> Array:
        """Torques that produce a motion: the chosen terms of M a + C v + G + S + F.

        Dry friction of a joint at rest may take any value up to its level; it is taken as zero
        here.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n).
            v: Joint velocities in [rad/s] or [m/s], likewise.
            a: Joint accelerations in [rad/s²] or [m/s²], likewise.
            terms: Which terms to add up.

        Returns:
            Joint torques in [N m] or [N], shape of the arguments.

        Raises:
            InvalidInput: If a shape or a value is not allowed.
        """
        if terms is Term.ALL and (found := self._one.inverse(q, v, a)) is not None:
            return found
        self._say_massless()
        chosen = _chosen(terms)
        call = self._one.inverse if terms == Term.ALL else unanswered
        return self._by_code(call, partial(self._inverse, chosen), q=q, v=v, a=a)

    def _inverse(self, terms: list[bool], q: Array, v: Array, a: Array) -> Array:
        """The same of valid vectors, by Pinocchio; ``terms``: as from ``_chosen``."""
        inertia, coriolis, gravity, friction, spring = terms
        moving = v if coriolis else np.zeros_like(v)
        pushed = a if inertia else np.zeros_like(a)
        tau = self._rigid.inverse(q, moving, pushed, self._gravity if gravity else _WEIGHTLESS)
        if spring and self.model.springs:
            tau = tau + self._rigid.spring(q, v)
        if all(terms):
            tau = tau - self._external
        if not friction:
            return tau
        sliding = np.sign(v) if self.steady_friction.has_dry else v
        needed: Array = self.steady_friction.demanded(tau, v, sliding, q)
        return needed

    def _say_massless(self) -> None:
        """Warn once if all torques of gravity and inertia are zero since nothing has mass."""
        if not self._silent:
            self._silent = True
            _log.warning("robot '%s': %s", self.model.pin.name, MASSLESS)

    def command(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Commands that produce a motion, in units of ``model.command_unit``, with rigid drives.

        Arguments and errors as those of ``inverse``; without drives, the sum of all its terms.
        """
        tau, (q, v, a) = self.inverse(q, v, a), vectors(self.joint_names, q=q, v=v, a=a)
        rotors = self.command_map.rotor_inertia * a + self.command_map.rotor_damping * v
        return finite_answer(self.command_map(q, v, tau + rotors))

    def forward(self, q: ArrayLike, v: ArrayLike, tau: ArrayLike) -> Array:
        """Accelerations that torques produce: M⁻¹ (τ - C v - G - S - F).

        A joint with dry friction that is exactly at rest sticks, with zero acceleration, while its
        holding torque is within the static level; otherwise it begins to slide, as in the
        simulator. End stops and contacts are ignored; bilateral constraints are enforced: see
        ``constrained_forward``.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n).
            v: Joint velocities in [rad/s] or [m/s], likewise.
            tau: Joint torques in [N m] or [N], likewise.

        Returns:
            Joint accelerations in [rad/s²] or [m/s²], shape of the arguments.

        Raises:
            InvalidInput: If a shape or a value is not allowed.
            ModelError: If the mass matrix is singular to rounding.
        """
        if (found := self._one.forward(q, v, tau)) is not None:
            return found
        return self._by_code(self._one.forward, self._forward, q=q, v=v, tau=tau)

    def _forward(self, q: Array, v: Array, tau: Array) -> Array:
        """The same of valid vectors, by Pinocchio."""
        if self.model.scene.bilateral:
            return self.constrained.forward(q, v, tau, self._active, self._external)[0]
        if not self._regular:
            check_regular(self._rigid.mass_matrix(some_positions(self.n)), self.joint_names)
            self._regular = True
        free = tau - self.steady_friction(v, np.sign(v), q, tau) + self._external
        if self.model.springs:
            free = free - self._rigid.spring(q, v)
        a = self._rigid.forward(q, v, free)
        rows = self._at_rest.resting(v).any(axis=-1)
        if rows.any():
            a[rows] = self._begun(*(np.atleast_2d(x)[np.atleast_1d(rows)] for x in (q, v, tau)))
        return a

    def _begun(self, q: Array, v: Array, tau: Array) -> Array:
        """Accelerations of points at which joints with dry friction are at rest, shape (k, n)."""
        bias = self._rigid.frictionless(q, v, np.zeros_like(v)) - self._external
        none = np.zeros((len(q), 0, self.n))
        points = Points(q, v, tau, self._rigid.mass_matrix(q), bias, none, none[..., 0], 0)
        return self._at_rest.motion(points)[0]

    @cached_property
    def constrained(self) -> Constrained:
        """Dynamics with the bilateral constraints: names, multipliers, closed states."""
        return Constrained(self.model, self._rigid)

    def constrained_forward(
        self, q: ArrayLike, v: ArrayLike, tau: ArrayLike, active: Collection[str] | None = None
    ) -> tuple[Array, Array]:
        """Accelerations and λ of τ = M a + C v + G + S + F + Aᵀλ; see ``Constrained.forward``."""
        q, v, tau = vectors(self.joint_names, q=q, v=v, tau=tau)
        active = self._active if active is None else active
        a, lam = self.constrained.forward(q, v, tau, active, self._external)
        return finite_answer(a), finite_answer(lam)

    def constrained_inverse(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, lam: ArrayLike
    ) -> Array:
        """Torques M a + C v + G + S + F + Aᵀλ; see ``Constrained.inverse``."""
        q, v, a = vectors(self.joint_names, q=q, v=v, a=a)
        return finite_answer(self.constrained.inverse(q, v, a, lam, self._external))

    def contact_torque(self, q: ArrayLike, wrench: ArrayLike, frame: str | None = None) -> Array:
        """Joint torques Jᵀ f that exert a wrench on the world; see ``constrained``."""
        (q,) = vectors(self.joint_names, q=q)
        return finite_answer(contact_torque(self.model, q, wrench, frame))

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Joint-space inertia M(q) with armature in [kg m²] or [kg], shape (n, n) or (k, n, n)."""
        if (M := self._one.mass_matrix(q)) is not None:
            return M
        return self._by_code(self._one.mass_matrix, self._rigid.mass_matrix, q=q)

    def coriolis_matrix(self, q: ArrayLike, v: ArrayLike) -> Array:
        """Coriolis matrix C(q, v), with dM/dt - 2 C skew-symmetric, shape (n, n) or (k, n, n)."""
        if (C := self._one.coriolis_matrix(q, v)) is not None:
            return C
        return self._by_code(self._one.coriolis_matrix, self._rigid.coriolis_matrix, q=q, v=v)

    def gravity(self, q: ArrayLike) -> Array:
        """Gravity torques G(q) that balance the arm's weight, in [N m] or [N], shape of ``q``."""
        if (G := self._one.gravity(q)) is not None:
            return G
        self._say_massless()
        return self._by_code(self._one.gravity, self._rigid.gravity, q=q)

    def spring(self, q: ArrayLike, v: ArrayLike | None = None) -> Array:
        """Torques S(q, v) that balance springs and their dampers in [N m] or [N], shape of ``q``.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n).
            v: Joint velocities in [rad/s] or [m/s], likewise; None for zero.

        Raises:
            InvalidInput: If a shape or a value is not allowed.
        """
        q, v = vectors(self.joint_names, q=q, v=np.zeros(self.n) if v is None else v)
        return finite_answer(self._rigid.spring(q, v))

    def friction(
        self,
        v: ArrayLike,
        direction: ArrayLike | None = None,
        q: ArrayLike | None = None,
        load: ArrayLike | None = None,
    ) -> Array:
        """Friction torques F(v) of a steady motion in [N m] or [N], shape of ``v``.

        Args:
            v: Joint velocities in [rad/s] or [m/s], shape (n,) or (k, n).
            direction: Sliding direction of each joint, a sign; None for the sign of ``v``. Dry
                friction at rest may take any value up to its level; where the sign is zero, zero
                is returned.
            q: Joint positions in [rad] or [m]; required where friction depends on them.
            load: Torques of the drives in [N m] or [N], for friction that depends on them; zero
                unless given.

        Raises:
            InvalidInput: If a shape or a value is not allowed, or positions are expected.
        """
        plain = direction is None and q is None and load is None
        if plain and (found := self._one.friction(v)) is not None:
            return found
        if q is None and self.steady_friction.by_position:
            raise InvalidInput("friction depends on the position in this scene: q is expected")
        if plain:
            return self._by_code(self._one.friction, self._friction, v=v)
        still = np.zeros(self.n)
        v, direction, q, load = vectors(
            self.joint_names,
            v=v,
            direction=v if direction is None else direction,
            q=still if q is None else q,
            load=still if load is None else load,
        )
        return finite_answer(self.steady_friction(v, np.sign(direction), q, load))

    def _friction(self, v: Array) -> Array:
        still = np.zeros_like(v)
        torques: Array = self.steady_friction(v, np.sign(v), still, still)
        return torques

    def energy(self, q: ArrayLike, v: ArrayLike) -> tuple[Any, Any]:
        """Kinetic and potential energy in [J]: two floats, or two arrays of shape (k,).

        The kinetic energy includes that of the armature, the potential energy that of springs.
        """
        both = self._one.energies(q, v)
        if both is None:
            both = self._by_code(self._one.energies, self._rigid.energies, q=q, v=v)
        kinetic, potential = both.T if both.ndim == 2 else both.tolist()
        return kinetic, potential

    def pose(self, q: ArrayLike, frame: str) -> Array:
        """Pose of a frame in the world: T of x_world = T x_frame, (4, 4) or (k, 4, 4).

        The upper left part is the rotation, whose columns are the frame's axes, the last column
        the position in [m] (Craig, Introduction to Robotics, section 2.3).

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n).
            frame: Name of a link, a joint or another frame of the robot, as in
                ``model.frame_names``.

        Raises:
            InvalidInput: If a shape or a value is not allowed, or no frame has the name.
        """
        call = self._one.of_frame("pose", frame)
        if (T := call(q)) is not None:
            return T
        return self._by_code(call, self._rigid.of_frame("pose", frame), q=q)

    def jacobian(self, q: ArrayLike, frame: str) -> Array:
        """Jacobian of a frame: J q̇ is its velocity, (6, n) or (k, 6, n).

        The first three rows give the velocity of its origin in [m/s], the last three its angular
        velocity in [rad/s], in the axes of the world (Craig, section 5.7). See ``task_space`` for
        other axes. Arguments and errors as those of ``pose``.
        """
        call = self._one.of_frame("jacobian", frame)
        if (J := call(q)) is not None:
            return J
        return self._by_code(call, self._rigid.of_frame("jacobian", frame), q=q)

    def jacobian_derivative(self, q: ArrayLike, v: ArrayLike, frame: str) -> Array:
        """Derivative J̇ of the Jacobian by time: J q̈ + J̇ q̇ is the acceleration of the frame.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n).
            v: Joint velocities in [rad/s] or [m/s], likewise.
            frame: As for ``pose``.

        Returns:
            Shape (6, n) or (k, 6, n).

        Raises:
            InvalidInput: As ``pose``.
        """
        call = self._one.of_frame("jacobian_derivative", frame)
        if (J_dot := call(q, v)) is not None:
            return J_dot
        return self._by_code(call, self._rigid.of_frame("jacobian_derivative", frame), q=q, v=v)


def _chosen(terms: Term | int) -> list[bool]:
    """Flags of inertia, Coriolis, gravity, friction and springs."""
    if not isinstance(terms, int) or isinstance(terms, bool) or not 0 <= terms <= Term.ALL:
        raise InvalidInput(
            f"terms = {terms!r}; allowed: a sum of INERTIA 1, CORIOLIS 2, GRAVITY 4, "
            "FRICTION 8, SPRING 16"
        )
    bits = int(terms)
    return [bool(bits & bit) for bit in _BITS]


def model_of(dynamics: Any) -> ArmModel:
    """The model of a ``Dynamics``; a model is its own.

    Raises:
        InvalidInput: If it is neither.
    """
    if isinstance(dynamics, ArmModel):
        return dynamics
    if isinstance(dynamics, Dynamics):
        return dynamics.model
    raise InvalidInput(
        f"dynamics is of type {type(dynamics).__name__}; an instance of Dynamics is expected, "
        "such as Dynamics('panda') or sim.dynamics"
    )
