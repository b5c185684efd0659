# SPDX-License-Identifier: Apache-2.0
"""Controllers by name with common settings, all for joint references."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, numbers, positive, unit_vector
from arm_dynamics.attributes import frozen
from arm_dynamics.control import computed_torque, custom, joint_space, task_space
from arm_dynamics.control.compiled_law import with_code
from arm_dynamics.control.controller import AnyController
from arm_dynamics.control.disturbance_observer import DisturbanceObserver
from arm_dynamics.control.friction_compensation import FrictionFeedForward
from arm_dynamics.control.pole_placement import MARGIN, gain, largest_delay, tuned, typical_inertia
from arm_dynamics.control.wrappers import Saturated, WithAddedTorques
from arm_dynamics.dynamics.dynamics import Dynamics, model_of
from arm_dynamics.exceptions import InvalidInput, choices, known_names
from arm_dynamics.model.arm import postures
from arm_dynamics.task_space.axes import chosen_axes
from arm_dynamics.task_space.inertia import axis_masses
from arm_dynamics.task_space.task_space import TaskSpace

_LARGEST_FORCE = 1e4  # [N]
_LARGEST_DAMPING = 1.5  # of dt times K_d; from 2 on an acceleration that is held swings up


def _tunable(default: Any, description: str, **about: Any) -> Any:
    """A setting that is a parameter of the controller node, too.

    Args:
        default: Its default.
        description: What it is, with its unit.
        **about: ``parameter``, its name there if that is another one; ``low`` and ``high``, its
            range; ``each_joint``, whether it may be a number for each joint; ``read_only``,
            whether it is fixed once the node runs.
    """
    return field(default=default, metadata={"description": description, **about})


@frozen
class Settings:
    """Settings of a controller made by name.

    Each has a default and a description with its unit, from which the controller node declares a
    parameter, except the limits, which come from its model. Task-space controllers use one
    bandwidth and damping ratio for all axes, and need a frame.

    Attributes:
        limit: Torque limits in [N m] or [N], a number or shape (n,), for controllers with memory.
    """

    dt: float = _tunable(
        1e-3, "Time between joint states, for controllers with memory [s]",
        parameter="control_period", low=1e-6, high=1.0, read_only=True,
    )  # fmt: skip
    bandwidth: ArrayLike = _tunable(
        20.0, "Bandwidth of the error [rad/s]: one, or one for each joint", each_joint=True
    )
    damping_ratio: ArrayLike = _tunable(
        1.0, "Damping ratio of the error: one, or one for each joint", each_joint=True
    )
    stiffness: ArrayLike = _tunable(
        0.0, "Stiffness of joint_impedance, one or one for each joint [N m/rad, N/m], and of "
        "cartesian_impedance, one or one for each axis [N/m, N m/rad]; all 0: as bandwidth says",
        each_joint=True,
    )  # fmt: skip
    damping: ArrayLike = _tunable(
        0.0, "Damping of both, likewise [N m s/rad, N s/m]; all 0: as damping_ratio says",
        each_joint=True,
    )  # fmt: skip
    frame: str = _tunable(
        "", "Frame of task-space controllers; empty: none", parameter="task_frame"
    )
    axes: str | tuple[str, ...] = _tunable(
        "pose", 'Axes that they control: pose, position, orientation, or some of "x y z rx ry rz"',
        parameter="task_axes",
    )  # fmt: skip
    force: float = _tunable(
        0.0, "Force with which motion_force presses [N]", low=-_LARGEST_FORCE, high=_LARGEST_FORCE
    )
    direction: tuple[float, ...] = _tunable(
        (0.0, 0.0, -1.0), "Direction of that force in the world",
        parameter="force_direction",
    )  # fmt: skip
    friction: bool = _tunable(
        False, "Add feed-forward of the scene's friction (computed_torque always does)"
    )
    observer: float = _tunable(
        0.0, "Bandwidth of a disturbance observer [1/s]; 0: none", low=0.0, high=1e4
    )
    saturate: bool = _tunable(False, "Clip torques at the scene's effort limits, with a warning")
    limit: ArrayLike = np.inf

    def __post_init__(self) -> None:
        """Refuse settings that are invalid for every controller."""
        positive("control_period", self.dt)
        fastest, rate = np.pi / self.dt, "rad/s, half a turn in a control period"
        _within("damping_ratio", self.damping_ratio, 100.0, "beyond which errors hardly decay")
        least = float(numbers("damping_ratio", self.damping_ratio).min())
        late = float(largest_delay(1.0, 2.0 * least, 1.0)) / (1.5 * self.dt)
        between = f"0 to {late:.3g} between nodes, where torques act a period late; otherwise "
        _within("bandwidth", self.bandwidth, fastest, rate, between)
        if len({np.size(self.bandwidth), np.size(self.damping_ratio), 1}) == 3:
            raise InvalidInput(
                f"bandwidth = {self.bandwidth!r}, damping_ratio = {self.damping_ratio!r}; "
                "allowed: one number, or as many as there are joints"
            )
        _within("stiffness", self.stiffness, 1e6, "N/m, N m/rad")
        _within("damping", self.damping, 1e5, "N s/m, N m s/rad")
        _within("observer", self.observer, 1e4, "1/s")
        _within("force", np.abs(numbers("force", self.force)), _LARGEST_FORCE, "N")
        unit_vector("force_direction", self.direction, 3)
        try:
            chosen_axes(self.axes)
        except InvalidInput as error:
            raise InvalidInput(f"task_axes: {error}") from None


def _within(name: str, value: ArrayLike, most: float, why: str, first: str = "") -> None:
    """Refuse numbers that are not finite, below zero or above ``most``."""
    array = numbers(name, value)
    if array.ndim > 1 or np.any(array < 0.0) or np.any(array > most):
        raise InvalidInput(f"{name} = {value!r}; allowed: {first}0 to {most:.6g} ({why})")


def make_controller(
    name: str | custom.Maker, dynamics: Dynamics, settings: Settings | None = None
) -> AnyController:
    """Make a controller that follows joint references (``trajectory.Reference``).

    Torques of a reference are added to those of the controller, before limits.

    Args:
        name: One of ``NAMES``, or a user-defined class (see ``Controller``). It is called with
            those of its arguments that are named ``dynamics``, ``settings``, or as one of
            ``OFFERED_SETTINGS``; others must have defaults, and keep them.
        dynamics: Its model; used from one thread only.
        settings: Its settings.

    Raises:
        InvalidInput: If the name is unknown, a task controller has no frame, a setting is not
            allowed, or a user-defined class cannot be used.

    Example:
        >>> control = make_controller("computed_torque", Dynamics("panda.yaml"))
    """
    settings = Settings() if settings is None else settings
    if not isinstance(settings, Settings):
        raise InvalidInput(f"settings = {settings!r}; an instance of Settings is expected")
    model_of(dynamics)
    control, limit = _without_extras(name, dynamics, settings), settings.limit
    is_user_defined = isinstance(control, custom.CheckedController)
    if settings.friction and (terms := _missing_friction(name, control)):
        control = FrictionFeedForward(control, dynamics.model, terms)
    control = WithAddedTorques(control, dynamics.n)
    if settings.observer:
        control = DisturbanceObserver(control, dynamics, settings.dt, settings.observer, limit)
    control = with_code(control, dynamics.model, is_user_defined=is_user_defined)
    return Saturated(control, limit, dynamics.n) if settings.saturate else control


# Settings that a user-defined controller may take one by one. It gets no others by name: a setting
# that is added later must not replace a default of its own.
OFFERED_SETTINGS = ("dt", "bandwidth", "damping_ratio", "frame", "axes", "limit")


def _without_extras(
    name: str | custom.Maker, dynamics: Dynamics, settings: Settings
) -> AnyController:
    if not isinstance(name, str):
        offered = {"dynamics": dynamics, "settings": settings}
        offered |= {key: getattr(settings, key) for key in OFFERED_SETTINGS}
        return custom.construct(name, offered, dynamics.n)
    if (kind := _KINDS.get(name)) is None:
        raise InvalidInput(f"controller = {name!r}; allowed: {choices(name, _KINDS)}")
    if not kind.in_task_space:  # those have axes instead of joints
        for key in ("bandwidth", "damping_ratio"):
            gain(key, getattr(settings, key), dynamics.n)
    return kind.build(dynamics, settings)


def _missing_friction(name: str | custom.Maker, control: AnyController) -> str | None:
    """The friction that a controller leaves out; None if that is its own affair."""
    if isinstance(name, str):
        return _KINDS[name].missing_friction
    assert isinstance(control, custom.CheckedController)
    if (terms := control.friction_terms) is None and not custom.accepts(name, "settings"):
        raise InvalidInput(
            f"friction = True: controller {custom.maker_name(name)} does not say which friction "
            "it leaves out; allowed with a class attribute friction_terms = 'all', or 'dry' if "
            "its torques include viscous friction, or with an argument 'settings' of its own"
        )
    return terms


def refuse_unsteady(s: Settings) -> None:
    """Refuse a bandwidth with which any arm swings up if torques act one ``dt`` late."""
    omega, zeta = numbers("bandwidth", s.bandwidth), numbers("damping_ratio", s.damping_ratio)
    most, sensible = (
        np.minimum(1.0, largest_delay(omega**2, 2.0 * zeta * omega, margin) / (1.5 * s.dt))
        for margin in (1.0, MARGIN)
    )
    if most.min() < 1.0:
        raise InvalidInput(
            f"bandwidth = {s.bandwidth!r}; allowed: at most {_rounded(most * omega)} rad/s, "
            f"beyond which torques that act {s.dt:g} s late and are held for {s.dt:g} s make the "
            f"arm swing up; sensible: at most {_rounded(sensible * omega)} rad/s"
        )


def mismatch(dynamics: Dynamics, s: Settings, joints: Sequence[str], dt: float) -> str:
    """Warning of a controller for other joints, or other ticks in [s], than those of an arm.

    Another number of joints is refused.
    """
    own, theirs = known_names(dynamics.joint_names, 8), known_names(joints, 8)
    if dynamics.n != len(joints):
        raise InvalidInput(f"the controller's scene has the joints {own}; the arm has {theirs}")
    if dynamics.joint_names != tuple(joints):
        return f"the controller's joints, {own}, command the arm's, {theirs}, in their order"
    if not np.isclose(s.dt, dt):
        return f"the controller's settings have dt = {s.dt:g} s, but its torques act for {dt:g} s"
    return ""


def overreach(name: str | custom.Maker, dynamics: Dynamics, s: Settings, delay: float) -> str:
    """Warning of gains that a loop does not carry; empty if it carries them.

    ``delay`` is the time in [s] from a state until its torque acts, which is then held for ``dt``.
    """
    if name == "float" or not (isinstance(name, str) or custom.accepts(name, "bandwidth")):
        return ""
    kind = _KINDS.get(name) if isinstance(name, str) else None
    by_force, k, c = _feedback(kind, dynamics, s)
    share = np.minimum(1.0, largest_delay(k, c) / (delay + 0.5 * s.dt))
    why = f"torques that act {delay:.2g} s late and are held for {s.dt:g} s"
    if kind and kind.is_tuned:
        _, part = typical_inertia(dynamics, c * s.dt)
        if part < share.min():
            share, lowered = np.asarray(part), "" if by_force else ", for which gains are lowered"
            why = f"the lightest motions of the arm at {s.dt:g} s per cycle{lowered}"
    if (least := share.min()) == 1.0:
        return ""
    gains = f"bandwidth = {s.bandwidth!r}"
    most = f"{_rounded(share * numbers('bandwidth', s.bandwidth))} rad/s"
    if by_force:
        gains = f"stiffness = {s.stiffness!r} with damping = {s.damping!r}"
        most = f"{least**2:.2g} of the stiffness, and {least:.2g} of the damping, if it is given"
    return f"{gains} is too much for {why}; sensible: at most {most}"


def _feedback(kind: _Kind | None, dynamics: Dynamics, s: Settings) -> tuple[bool, Array, Array]:
    """Whether gains are in units of force, and stiffness and damping by inertia."""
    omega, zeta = numbers("bandwidth", s.bandwidth), numbers("damping_ratio", s.damping_ratio)
    K, D = _nonzero("stiffness", s.stiffness), _nonzero("damping", s.damping)
    if kind is None or not kind.is_impedance or (K is None and D is None):
        return False, omega**2, 2.0 * zeta * omega
    if kind.in_task_space:
        m = _typical_masses(_task(dynamics, s), dynamics)
    else:
        m, _ = typical_inertia(dynamics, 0.0)
    k = omega**2 if K is None else K / m
    return True, k, 2.0 * zeta * np.sqrt(k) if D is None else D / m


def _rounded(most: Array) -> str:
    """Numbers of every joint, or the one of all."""
    return ", ".join(f"{x:.3g}" for x in np.atleast_1d(most).tolist())


def _pid(dynamics: Dynamics, s: Settings) -> AnyController:
    (kp, kd), omega = _tuned(dynamics, s), numbers("bandwidth", s.bandwidth)
    rate = 2.0 * numbers("damping_ratio", s.damping_ratio) * omega
    ki = kp * omega / 3.0 * typical_inertia(dynamics, rate * s.dt)[1]
    return joint_space.PID(dynamics.n, kp, ki, kd, s.dt, s.limit)


def _cartesian_impedance(dynamics: Dynamics, s: Settings) -> AnyController:
    task, K = _task(dynamics, s), _nonzero("stiffness", s.stiffness)
    if K is None:
        K = numbers("bandwidth", s.bandwidth) ** 2 * _typical_masses(task, dynamics)
    law = partial(task_space.CartesianImpedance, damping=_nonzero("damping", s.damping))
    return _along_joints(law, task, s, K)


def _joint_impedance(dynamics: Dynamics, s: Settings) -> AnyController:
    if (K := _nonzero("stiffness", s.stiffness)) is None:
        K, _ = _tuned(dynamics, s)
    D = _nonzero("damping", s.damping)
    return joint_space.JointImpedance(dynamics, K, s.damping_ratio, D)


def _nonzero(name: str, value: ArrayLike) -> Array | None:
    """Gains in units of force or torque; None if all are 0, so that the bandwidth decides."""
    gains = numbers(name, value)
    return gains if gains.any() else None


def _along_joints(
    law: Callable[..., task_space.TaskController], task: TaskSpace, s: Settings, *gains: Any
) -> AnyController:
    # Held for dt, ë = -2 ζ ω ė takes ė to (1 - 2 ζ ω dt) ė from tick to tick.
    damping = 2.0 * numbers("bandwidth", s.bandwidth) * numbers("damping_ratio", s.damping_ratio)
    if np.any(damping * s.dt > _LARGEST_DAMPING):
        raise InvalidInput(
            f"bandwidth = {s.bandwidth!r} with damping_ratio = {s.damping_ratio!r}: a controller "
            f"in task space is steady at {1.0 / s.dt:g} states per second while bandwidth times "
            f"damping_ratio is at most {0.5 * _LARGEST_DAMPING / s.dt:g} rad/s"
        )
    posture = {"posture_bandwidth": s.bandwidth, "friction": s.friction}
    return task_space.AlongJoints(law(task, *gains, s.damping_ratio, **posture), task, s.force)


class _Kind(NamedTuple):
    """A controller that comes with the suite.

    Attributes:
        build: Makes it.
        missing_friction: Friction that has to be fed forward, ``all`` or ``dry``; None if it
            includes friction, or has no reference.
        is_tuned: Whether its gains follow from the arm's inertia, see ``tuned``.
        is_impedance: Whether its gains may be in units of force.
        in_task_space: Whether it controls a frame.
    """

    build: Callable[[Dynamics, Settings], AnyController]
    missing_friction: str | None = None
    is_tuned: bool = False
    is_impedance: bool = False
    in_task_space: bool = False


_KINDS = {
    "pd": _Kind(lambda dyn, s: joint_space.PD(dyn.n, *_tuned(dyn, s)), "all", is_tuned=True),
    "pid": _Kind(_pid, "all", is_tuned=True),
    "pd_gravity": _Kind(
        lambda dyn, s: joint_space.PDGravity(dyn, *_tuned(dyn, s)), "all", is_tuned=True
    ),
    "feed_forward": _Kind(
        lambda dyn, s: joint_space.FeedForwardPD(dyn, *_tuned(dyn, s)), "dry", is_tuned=True
    ),
    "computed_torque": _Kind(
        lambda dyn, s: computed_torque.ComputedTorque(dyn, s.bandwidth, s.damping_ratio, s.dt)
    ),
    "operational_space": _Kind(
        lambda dyn, s: _along_joints(task_space.OperationalSpace, _task(dyn, s), s, s.bandwidth),
        in_task_space=True,
    ),
    "motion_force": _Kind(
        lambda dyn, s: _along_joints(
            task_space.MotionForce, _task(dyn, s), s, s.direction, s.bandwidth
        ),
        in_task_space=True,
    ),
    "joint_impedance": _Kind(_joint_impedance, "dry", is_tuned=True, is_impedance=True),
    "cartesian_impedance": _Kind(_cartesian_impedance, is_impedance=True, in_task_space=True),
    "float": _Kind(lambda dyn, s: joint_space.GravityCompensation(dyn)),
}
NAMES: tuple[str, ...] = tuple(_KINDS)
"""Names of the controllers that come with the suite."""
IN_TASK_SPACE = tuple(name for name, kind in _KINDS.items() if kind.in_task_space)


def _tuned(dynamics: Dynamics, s: Settings) -> tuple[Array, Array]:
    return tuned(dynamics, s.bandwidth, s.damping_ratio, dt=s.dt)


def _typical_masses(task: TaskSpace, dynamics: Dynamics) -> Array:
    """Median mass of every axis over postures, shape (m,)."""
    q = postures(dynamics.model, 200)
    J, W = task.jacobian(q), np.linalg.inv(dynamics.mass_matrix(q))
    A = J @ W @ np.swapaxes(J, 1, 2)
    masses = [axis_masses(*pair) for pair in zip(A, task.terms(q).inertia, strict=True)]
    return np.asarray(np.median(masses, axis=0))


def _task(dynamics: Dynamics, s: Settings) -> TaskSpace:
    if not s.frame:
        raise InvalidInput("frame (task_frame of the node) is not given; a frame is expected")
    return TaskSpace(dynamics, s.frame, selection=s.axes)
