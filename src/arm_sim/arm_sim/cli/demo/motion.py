# SPDX-License-Identifier: Apache-2.0
"""A motion for any arm: within its joint, velocity and effort limits."""

from typing import Any, NamedTuple

import numpy as np

from arm_dynamics import ArmModel, Dynamics, InvalidInput, Scene
from arm_dynamics.arrays import Array
from arm_dynamics.scene.schema import Initial
from arm_dynamics.trajectory import Limits, Trajectory, Waypoint
from arm_dynamics.trajectory.waypoints import quintic

TURN, SLIDE = 0.6, 0.15  # [rad], [m]: largest excursion from the start
SHARE_OF_RANGE = 0.3  # largest excursion as a fraction of a joint's range
MARGIN = 0.05  # margin at the ends of a joint's range, as a fraction of it
SPEED_SHARE, EFFORT_SHARE = 0.7, 0.8  # fraction of the limits that the motion may use
WEIGHT_SHARE = 0.6  # fraction of the effort limits that holding the start may require
SECONDS_A_POINT = 1.4  # of the motion, from one way point to the next
SHRINK, TRIES = 0.8, 30  # of the excursion with each try, until limits are kept
SAMPLES_A_SECOND = 100  # at which the limits are checked


class DemoMotion(NamedTuple):
    """Start and waypoints of the arm.

    Attributes:
        model: The arm with that start.
        waypoints: Points after the start; the last one is the start again, at rest.
        trajectory: The trajectory through them.
        effort_share: Largest torque relative to its limit; 0 without limits.
    """

    model: ArmModel
    waypoints: tuple[Waypoint, ...]
    trajectory: Trajectory
    effort_share: float


def choose_motion(scene: Scene, duration: float) -> DemoMotion:
    """Choose a motion of ``duration`` in [s] for the arm of a scene.

    The scene's initial position is kept if it is within the joint limits, the drives can hold the
    arm there and there is room to move; else another one is searched. Excursions are reduced until
    torques and speeds are within the limits.

    Raises:
        InvalidInput: If no joint has room to move, or the drives are too weak for any motion.
    """
    dynamics = Dynamics(ArmModel(scene))
    model = dynamics.model
    if not np.any(model.position_upper > model.position_lower):
        raise InvalidInput("no joint of this arm can move: all lower limits equal the upper ones")
    q0 = model.q0
    inside = np.all((model.position_lower <= q0) & (q0 <= model.position_upper))
    if inside and _weight_shares(dynamics, q0).max() <= EFFORT_SHARE:
        if motion := _around(q0, dynamics, duration):
            return motion
    if motion := _around(_better_start(dynamics), dynamics, duration):
        return motion
    raise InvalidInput(
        f"no motion of {duration:g} s is small enough for the speed and effort limits; "
        "allowed: a longer --duration, or a scene with other limits or another start"
    )


def _around(start: Array, dynamics: Dynamics, duration: float) -> DemoMotion | None:
    """The largest motion around ``start`` within all limits; None if there is none."""
    model, limits = dynamics.model, Limits.of(dynamics.model)
    count = max(2, round(duration / SECONDS_A_POINT))
    times = duration / count * np.arange(1, count + 1)
    # Each joint at its own frequency, relative to its largest excursion.
    point, joint = np.arange(1, count + 1)[:, None], np.arange(model.n)
    swings = np.sin(2.0 * np.pi * (point * (0.29 + 0.045 * (joint % 4)) + 0.13 * joint))
    swings[-1] = 0.0
    span = model.position_upper - model.position_lower
    most = np.where(model.turning, TURN, SLIDE)
    excursion = np.minimum(most, SHARE_OF_RANGE * span)
    # At a distance from the limits, unless the start is closer.
    margin = MARGIN * np.where(np.isfinite(span), span, 0.0)
    lower = np.minimum(model.position_lower + margin, start)
    upper = np.maximum(model.position_upper - margin, start)
    for k in range(TRIES):
        points = np.clip(start + SHRINK**k * excursion * swings, lower, upper)
        waypoints = tuple(Waypoint(t, q) for t, q in zip(times, points, strict=True))
        try:
            trajectory = quintic([Waypoint(0.0, start), *waypoints], limits)
        except InvalidInput:
            continue  # it exceeds a joint limit between its waypoints
        samples = max(20, round(SAMPLES_A_SECOND * trajectory.duration))
        motion = [trajectory.sample(t) for t in np.linspace(0.0, trajectory.duration, samples)]
        q, v, a = (np.array([getattr(point, name) for point in motion]) for name in "qva")
        speed = float((abs(v) / model.velocity_limit).max())
        effort = float((abs(dynamics.inverse(q, v, a)) / model.effort_limit).max())
        if speed <= SPEED_SHARE and effort <= EFFORT_SHARE:
            # Locked joints keep their initial positions.
            position: dict[str, Any] = dict(model.scene.initial.position)
            position |= dict(zip(model.joint_names, start.tolist(), strict=True))
            scene = model.scene.model_copy(update={"initial": Initial(position=position)})
            return DemoMotion(ArmModel(scene), waypoints, trajectory, effort)
    return None


def _better_start(dynamics: Dynamics) -> Array:
    """A posture away from the limits in which the drives can hold the arm easily."""
    model = dynamics.model
    low = np.where(np.isfinite(model.position_lower), model.position_lower, -np.pi)
    high = np.where(np.isfinite(model.position_upper), model.position_upper, np.pi)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    low, high = middle - 0.6 * half, middle + 0.6 * half
    samples = np.random.default_rng(0).uniform(low, high, (200, model.n))
    postures = np.vstack([np.clip(model.q0, low, high), middle, samples])
    shares = _weight_shares(dynamics, postures)
    largest = shares.max(axis=1)
    light = np.flatnonzero(largest <= WEIGHT_SHARE)
    best = light[0] if light.size else largest.argmin()
    if largest[best] > EFFORT_SHARE:
        joint = shares[best].argmax()
        needed = shares[best, joint] * model.effort_limit[joint]
        raise InvalidInput(
            f"this arm cannot carry its own weight: joint '{dynamics.joint_names[joint]}' needs "
            f"{needed:.4g} N m or N, its effort limit is {model.effort_limit[joint]:.4g}; "
            "allowed: a scene whose start or limits make it possible"
        )
    return postures[best]


def _weight_shares(dynamics: Dynamics, q: Array) -> Array:
    """Holding torques, springs included, relative to the effort limits."""
    return np.abs(dynamics.gravity(q) + dynamics.spring(q)) / dynamics.model.effort_limit
