# SPDX-License-Identifier: Apache-2.0
"""Dynamics computed by Pinocchio: the reference for everything else in the suite."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import copy
from functools import cached_property, partial
from inspect import Parameter, Signature
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.actuation.command_map import CommandMap
from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array, each, finite_answer, vectors
from arm_dynamics.attributes import check_arguments, sealed
from arm_dynamics.codegen.python_call import PythonCall
from arm_dynamics.dynamics.arm_models import arm_model
from arm_dynamics.dynamics.constrained import Constrained
from arm_dynamics.dynamics.contact_torque import contact_torque
from arm_dynamics.dynamics.stiction import States, Stiction
from arm_dynamics.exceptions import ARM, InvalidInput, degrees_meant
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.frame_motion import check_frame
from arm_dynamics.model.regularity import MASSLESS, check_regular, some_positions
from arm_dynamics.scene.load import SceneSource
from arm_dynamics.terms import table
from arm_dynamics.terms.compiled import calls
from arm_dynamics.terms.evaluator import MANY, TermEvaluator
from arm_dynamics.terms.table import FORWARD, INVERSE, TERMS, WITHOUT_FRICTION, Entry, Term

_log = logging.getLogger(__name__)
_FLOAT, _ALL = np.dtype(float), Term.ALL
LARGE = 1e50  # vectors up to which no term overflows
# Positions whose angles are checked: a person gives few, a loop many
CHECKED_POSITIONS = 100


def no_answer(*_: object) -> None:
    """No code answers."""


def _method_of(entry: Entry) -> Callable[..., Array]:
    """The method that answers an entry: by compiled code where there is some, else checked."""
    names = "self", *entry.parameters
    signature = Signature([Parameter(x, Parameter.POSITIONAL_OR_KEYWORD) for x in names])
    count = len(names) - 1

    def bound(self: Dynamics, *arguments: Any, **named: Any) -> tuple[Any, ...]:
        try:
            return signature.bind(self, *arguments, **named).args[1:]
        except TypeError as error:
            check_arguments(self, method, named)
            raise TypeError(f"Dynamics.{entry.method_name}() {error}") from None

    def plain(self: Dynamics, *arguments: Any, **named: Any) -> Array:
        if named or len(arguments) != count:
            arguments = bound(self, *arguments, **named)
        call: PythonCall = self._calls[entry]
        result = call(*arguments)
        return self._answer(entry, arguments, (), call) if result is None else result

    def of_frame(self: Dynamics, *arguments: Any, **named: Any) -> Array:
        if named or len(arguments) != count:
            arguments = bound(self, *arguments, **named)
        vectors, frame = arguments[:-1], arguments[-1]
        of_names: dict[Any, PythonCall] = self._calls[entry]
        call = of_names.get(frame, no_answer) if type(frame) is str else no_answer
        result = call(*vectors)
        return self._answer(entry, vectors, (frame,), call) if result is None else result

    method = of_frame if entry.selectors else plain
    shape = ", ".join(map(str, entry.shape))
    method.__name__ = entry.method_name
    method.__doc__ = f"{entry.about}\n\nIn [{entry.unit}], ({shape}) or (k, {shape})."
    vars(method)["__signature__"] = signature
    return method


# What external torques and active constraints change
_WITHOUT_CODE = dict.fromkeys((INVERSE, FORWARD), no_answer)


@sealed
class Dynamics:
    """Inverse and forward dynamics of one scene; keep one instance per thread.

    Every method takes vectors of shape (n,) or batches of shape (k, n) in the order of
    ``joint_names`` and returns results of the same kind; ``InvalidInput`` is raised where they
    overflow. Source of the algorithms: Featherstone, Rigid Body Dynamics Algorithms, 2008, as
    implemented by Pinocchio.

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
        "payloads: [{frame: …, mass: …}] or links: {NAME: {mass: …, com: …, inertia: …}}",
        "gravity": "build another Dynamics(scene), of a scene with gravity: [x, y, z]",
        "latex symbolic sympy": f"{ARM} export SCENE writes its equations, as C",
        "q v a tau state external": "its methods take them: inverse(q, v, a), forward(q, v, tau), "
        "under(external)",
    }
    _parts = ("model",)

    def __init__(self, scene: SceneSource | ArmModel) -> None:
        self.model = arm_model(scene)
        self.steady_friction = SteadyFriction.of(self.model)
        self.command_map = CommandMap(self.model)
        self._terms = TermEvaluator(self.model, self.steady_friction)
        self._numbers = self._terms.numbers
        self._stiction = Stiction(self.steady_friction)
        self._external, self._zeros = np.zeros(self.n), np.zeros(self.n)
        self._active: Collection[str] | None = None
        self._is_alone = True  # no external torques and other active constraints
        self._is_regular = False  # checked when accelerations are first requested
        self._is_warned = not self.model.massless  # warns when torques are first requested
        self._turning = self.model.turning
        self._checks_left = CHECKED_POSITIONS
        self._all_turn = self.model.coordinates_are_joints and bool(self._turning.all())
        self._calls: dict[Entry, Any] = {x: {} if x.selectors else no_answer for x in TERMS}

    def __repr__(self) -> str:
        """Its arm."""
        return repr(self.model).replace(type(self.model).__name__, type(self).__name__, 1)

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
        other._is_alone = False
        other._calls = self._calls | _WITHOUT_CODE
        return other

    def of_motions(self) -> Self:
        """The same arm, for computed states, in which many turns do not mean degrees."""
        other = copy(self)
        other._checks_left = 0
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
        for name in names:
            check_frame(self.model, name, self.model.frame_names)
        self._check_regular()
        requests = [
            (entry, selection)
            for entry in TERMS
            if entry.compiles(self.model)
            for selection in (zip(names) if entry.selectors else [()])
        ]
        compiled = calls(self.model, self.steady_friction, requests)
        other._calls = {
            entry: {name: compiled[entry, (name,)] for name in names}
            if entry.selectors
            else compiled.get((entry, ()), old)
            for entry, old in self._calls.items()
        }
        if not self._is_alone:
            other._calls |= _WITHOUT_CODE
        return other

    def _answer(
        self,
        entry: Entry,
        arguments: Sequence[Any],
        selection: tuple[Any, ...] = (),
        call: PythonCall = no_answer,
        otherwise: Callable[..., Array] | None = None,
        is_quick: bool = True,
    ) -> Array:
        """An entry at vectors, or at each row of batches, that ``call`` has not answered.

        Args:
            entry: The entry.
            arguments: Arguments of the entry that are numbers.
            selection: Arguments of the entry that are not numbers.
            call: Code of the entry.
            otherwise: Computes the entry of valid vectors where its formula alone does not.
            is_quick: Whether the formula alone computes single states.
        """
        is_quick = is_quick and call is no_answer and self._is_warned and not self._checks_left
        if is_quick and self._are_plain(entry, arguments):
            result: Array = entry.formula(self._numbers, *arguments, *selection)
            if result.ndim == 2 or -LARGE < sum(result.tolist()) < LARGE:
                return result
        for frame in selection:
            check_frame(self.model, frame, self.model.frame_names)
        checked = self._checked(entry, arguments)
        answer = otherwise or partial(self._terms, entry, selection=selection)
        if call is no_answer or (checked[0].ndim == 2 and len(checked[0]) >= MANY):
            return finite_answer(answer(*checked))

        def one(*state: Array) -> Array:
            result = call(*state)
            return finite_answer(answer(*state)) if result is None else result

        return each(one, *map(np.ascontiguousarray, checked))

    def _are_plain(self, entry: Entry, arguments: Sequence[Any]) -> bool:
        """Whether they are arrays of n finite numbers, which need no conversion.

        Values of motions of joints that all turn are not checked: torques show what is not finite.
        """
        shape, unchecked = self._zeros.shape, entry is INVERSE and self._all_turn
        for x in arguments:
            if type(x) is not np.ndarray or x.dtype is not _FLOAT or x.shape != shape:
                return False
            if not (unchecked or -LARGE < sum(x.tolist()) < LARGE):
                return False
        return True

    def _checked(self, entry: Entry, arguments: Sequence[Any]) -> list[Array]:
        """Vectors of the joints, or batches of one length, the first of them positions.

        Warns once of angles that are probably degrees, and of an arm without mass.
        """
        if not self._is_warned and entry in (INVERSE, table.GRAVITY):
            self._is_warned = True
            _log.warning("robot '%s': %s", self.model.pin.name, MASSLESS)
        checked = vectors(self.joint_names, **dict(zip(entry.arguments, arguments, strict=False)))
        if self._checks_left:
            first = np.atleast_2d(checked[0])[: self._checks_left]
            self._checks_left -= len(first)
            degrees = self._turning * (2.0 * first % 1.0 == 0.0)  # as people write them
            turned = np.max(abs(first) * degrees, axis=0)
            joint = int(np.argmax(turned))
            if remark := degrees_meant(turned[joint]):
                self._checks_left = 0
                _log.warning("position of joint '%s': %s", self.joint_names[joint], remark)
        return checked

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
        whole = terms is _ALL or (type(terms) is int and terms == _ALL)
        if whole and self._is_alone:
            call: PythonCall = self._calls[INVERSE]
            result = call(q, v, a)
            return self._answer(INVERSE, (q, v, a), (), call) if result is None else result
        external = self._external if whole else self._zeros
        state = self._checked(INVERSE, (q, v, a))
        return finite_answer(self._terms(INVERSE, *state, _factors(terms), external))

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
        call: PythonCall = self._calls[FORWARD]
        if (result := call(q, v, tau)) is not None:
            return result
        is_quick = self._is_alone and self._is_regular and not self.model.scene.bilateral
        if is_quick and self.steady_friction.joints.has_dry:  # a joint at rest may stick
            is_quick = isinstance(v, np.ndarray) and 0.0 not in v.tolist()
        return self._answer(FORWARD, (q, v, tau), (), call, self._forward, is_quick)

    def _forward(self, q: Array, v: Array, tau: Array) -> Array:
        """Accelerations as of ``forward``, of valid vectors, by Pinocchio."""
        if self.model.scene.bilateral:
            return self.constrained.forward(q, v, tau, self._active, self._external)[0]
        self._check_regular()
        a = self._terms(FORWARD, q, v, tau, self._external)
        rows = self._stiction.resting(v).any(axis=-1)
        if rows.any():
            q, v, tau = (np.atleast_2d(x)[np.atleast_1d(rows)] for x in (q, v, tau))
            bias = self._terms(INVERSE, q, v, 0.0 * v, WITHOUT_FRICTION, self._external)
            none, M = np.zeros((len(q), 0, self.n)), self._terms(table.MASS_MATRIX, q)
            states = States(q, v, tau, M, bias, none, none[..., 0], 0)
            a[rows] = self._stiction.motion(states)[0]
        return a

    def _check_regular(self) -> None:
        if not self._is_regular:
            M = self._terms(table.MASS_MATRIX, some_positions(self.n))
            check_regular(M, self.joint_names)
            self._is_regular = True

    @cached_property
    def constrained(self) -> Constrained:
        """Dynamics with the bilateral constraints: names, multipliers, closed states."""
        return Constrained(self.model, self._terms)

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
        """Joint torques Jᵀ f that exert a wrench on the world; see ``contact_torque``."""
        (q,) = vectors(self.joint_names, q=q)
        return finite_answer(contact_torque(self.model, q, wrench, frame))

    mass_matrix = _method_of(table.MASS_MATRIX)
    coriolis_matrix = _method_of(table.CORIOLIS_MATRIX)
    gravity = _method_of(table.GRAVITY)
    pose = _method_of(table.POSE)
    jacobian = _method_of(table.JACOBIAN)
    jacobian_derivative = _method_of(table.JACOBIAN_DERIVATIVE)

    def spring(self, q: ArrayLike, v: ArrayLike | None = None) -> Array:
        """Torques S(q, v) that balance springs and their dampers in [N m] or [N], shape of ``q``.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n).
            v: Joint velocities in [rad/s] or [m/s], likewise; None for zero.

        Raises:
            InvalidInput: If a shape or a value is not allowed.
        """
        call: PythonCall = self._calls[table.SPRING]
        state = q, self._zeros if v is None else v
        if (result := call(*state)) is not None:
            return result
        none = None if self.model.springs else lambda q, v: np.zeros(np.broadcast(q, v).shape)
        return self._answer(table.SPRING, state, (), call, none)

    def friction(
        self,
        v: ArrayLike,
        *,  # q before v, as everywhere else, is no direction
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
        if q is None and self.steady_friction.by_position:
            raise InvalidInput("friction depends on the position in this scene: q is expected")
        if direction is None and load is None:
            call: PythonCall = self._calls[table.FRICTION]
            state = self._zeros if q is None else q, v
            if (result := call(*state)) is not None:
                return result
            unloaded = self.steady_friction
            return self._answer(
                table.FRICTION, state, (), call, lambda q, v: unloaded(v, np.sign(v), q, 0.0 * v)
            )
        v, direction, q, load = vectors(
            self.joint_names,
            v=v,
            direction=v if direction is None else direction,
            q=self._zeros if q is None else q,
            load=self._zeros if load is None else load,
        )
        return finite_answer(self.steady_friction(v, np.sign(direction), q, load))

    def energy(self, q: ArrayLike, v: ArrayLike) -> tuple[Any, Any]:
        """Kinetic and potential energy in [J]: two floats, or two arrays of shape (k,).

        The kinetic energy includes that of the armature, the potential energy that of springs.
        """
        both = (call := self._calls[table.ENERGY])(q, v)
        if both is None:
            both = self._answer(table.ENERGY, (q, v), (), call)
        kinetic, potential = both.T if both.ndim == 2 else both.tolist()
        return kinetic, potential


for _entry in TERMS:
    if not hasattr(Dynamics, _entry.method_name):
        setattr(Dynamics, _entry.method_name, _method_of(_entry))


def call_entry(
    dynamics: Dynamics, entry: Entry, arguments: Mapping[str, Array], *selection: Any
) -> Any:
    """The result of the method of an entry, for arguments by name, of which it takes its own."""
    by_name = {**arguments, **dict(zip(entry.selectors, selection, strict=True))}
    return getattr(dynamics, entry.method_name)(**{x: by_name[x] for x in entry.parameters})


def _factors(terms: Term | int) -> Array:
    """Factors of inertia, Coriolis, gravity, friction and springs."""
    if not isinstance(terms, int) or isinstance(terms, bool) or not 0 <= terms <= Term.ALL:
        raise InvalidInput(
            f"terms = {terms!r}; allowed: a sum of INERTIA 1, CORIOLIS 2, GRAVITY 4, "
            "FRICTION 8, SPRING 16"
        )
    return np.array([float(bool(terms & term)) for term in Term])


def model_of(dynamics: Any) -> ArmModel:
    """The model of a ``Dynamics``; a model is its own."""
    if isinstance(dynamics, ArmModel):
        return dynamics
    if isinstance(dynamics, Dynamics):
        return dynamics.model
    raise InvalidInput(
        f"dynamics is of type {type(dynamics).__name__}; an instance of Dynamics is expected, "
        "such as Dynamics('panda') or sim.dynamics"
    )
