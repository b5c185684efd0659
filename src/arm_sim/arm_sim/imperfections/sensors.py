# SPDX-License-Identifier: Apache-2.0
"""Sensor measurements of a motion: quantized, noisy, filtered and delayed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.attributes import frozen
from arm_dynamics.control.filters.low_pass import LowPass
from arm_dynamics.exceptions import SceneError
from arm_dynamics.scene import Scene
from arm_dynamics.scene import imperfections as schema
from arm_dynamics.scene.imperfections import values
from arm_sim.imperfections.chance import Chance, Channel, normal
from arm_sim.imperfections.lines import Line


@frozen
class Measured:
    """Measurements at each time of a recording; arrays are read-only.

    Attributes:
        q: Positions in [rad] or [m], shape (k+1, n).
        v: Velocities in [rad/s] or [m/s], shape (k+1, n).
        effort: Torques of the tick before in [N m] or [N], shape (k+1, n).
    """

    q: Array
    v: Array
    effort: Array

    @classmethod
    def of(cls, rows: Array) -> Measured:
        """From rows of (q, v, effort)."""
        return cls(*(read_only(part) for part in np.split(rows, 3, axis=1)))


class Sensors:
    """Sensors of all joints, and the transmission of their measurements, sampled every tick.

    Attributes:
        measured: (q, v, effort) at the last sampled tick, shape (3n,): a persistent array,
            overwritten by every sample.
    """

    def __init__(self, scene: schema.Sensors, names: Sequence[str], dt: float) -> None:
        """Prepare measurements of zero.

        Args:
            scene: Keys of the sensors in the scene.
            names: Joints.
            dt: Length of a tick in [s].

        Raises:
            SceneError: If a filter's cut-off frequency is too high for this rate.
        """
        n, velocity = len(names), scene.velocity
        self._rate, self._step = 1.0 / dt, _steps(scene.position, names)
        is_rounded = self._step > 0.0
        self._is_rounded = is_rounded if is_rounded.any() else None
        self._q_disturbance = _disturbance(scene.position, names, scene.seed, Channel.POSITION)
        self._v_disturbance = _disturbance(velocity, names, scene.seed, Channel.VELOCITY)
        self._effort_disturbance = _disturbance(scene.effort, names, scene.seed, Channel.EFFORT)
        self._has_differences = velocity.source == "position"
        self._filter = _filter(velocity, names, dt)
        self._now, self._last_q, self._difference = (np.zeros(size) for size in (3 * n, n, n))
        self._q, self._v, self._effort = np.split(self._now, 3)  # views
        self._line: Line[Array] | None = None
        self.measured = self._now
        if not scene.perfect:
            self._line = Line(scene, dt, scene.seed, Channel.STATES)
            self.measured = np.zeros(3 * n)

    def restart(self, tick: int, q: Array, v: Array, effort: Array) -> None:
        """Restart: the state is known at once, and filters have settled.

        Velocities that are differences of positions are exact at this tick.
        """
        self._measure_position(tick, q)
        if self._filter is not None:
            self._filter.settle(v)
        self._measure_velocity_and_effort(tick, v, effort)
        if self._line is not None:
            self._line.restart(self._now.copy())
            self.measured[:] = self._now

    def sample(self, tick: int, q: Array, v: Array, effort: Array) -> None:
        """Sample the state at the end of the previous tick; then ``measured`` is what has arrived.

        Args:
            tick: Its index, one more than at the last sample.
            q: Positions in [rad] or [m], shape (n,).
            v: Velocities in [rad/s] or [m/s], shape (n,).
            effort: Torques that acted in [N m] or [N], shape (n,).
        """
        if self._has_differences:
            self._last_q[:] = self._q
            self._measure_position(tick, q)
            v = np.subtract(self._q, self._last_q, self._difference)
            v *= self._rate
        else:
            self._measure_position(tick, q)
        if self._filter is not None:
            v = self._filter.filtered(v)
        self._measure_velocity_and_effort(tick, v, effort)
        if self._line is not None:
            self.measured[:] = self._line.carry(tick, self._now.copy())

    def _measure_position(self, tick: int, q: Array) -> None:
        _write(self._q, q, self._q_disturbance, tick)
        if self._is_rounded is not None:
            np.divide(self._q, self._step, self._q, where=self._is_rounded)
            np.rint(self._q, self._q, where=self._is_rounded)
            np.multiply(self._q, self._step, self._q, where=self._is_rounded)

    def _measure_velocity_and_effort(self, tick: int, v: Array, effort: Array) -> None:
        _write(self._v, v, self._v_disturbance, tick)
        _write(self._effort, effort, self._effort_disturbance, tick)


def _write(place: Array, value: Array, disturbance: Chance | Array | None, tick: int) -> None:
    """Write a value with its disturbance, shape (n,), to an array."""
    if disturbance is None:
        place[:] = value
    else:
        error = disturbance.at(tick) if isinstance(disturbance, Chance) else disturbance
        np.add(value, error, place)


def _disturbance(
    part: schema.PositionSensor | schema.VelocitySensor | schema.EffortSensor,
    names: Sequence[str],
    seed: int,
    channel: Channel,
) -> Chance | Array | None:
    """Noise around an offset for one quantity, the offset alone, or None."""
    offset, noise = (np.array(values(by_joint, names)) for by_joint in (part.offset, part.noise))
    if noise.any():
        return Chance(seed, channel, normal(offset, noise))
    return offset if offset.any() else None


def sensors_of(scene: Scene, names: Sequence[str], dt: float) -> Sensors | None:
    """The sensors of a scene; None if it has none.

    Raises:
        SceneError: If a filter's cut-off frequency is too high for this rate.
    """
    return None if scene.sensors is None else Sensors(scene.sensors, names, dt)


def _steps(position: schema.PositionSensor, names: Sequence[str]) -> Array:
    """Steps of encoders, zero for exact ones; a joint's own takes precedence over that of all."""
    turns = {name: 2.0 * np.pi / counts for name, counts in position.counts.items()}
    levels = [{schema.ALL: 0.0}, position.resolution, turns]
    common = next(steps[schema.ALL] for steps in reversed(levels) if schema.ALL in steps)
    by_joint = {**position.resolution, **turns, schema.ALL: common}
    return np.array(values(by_joint, names))


def _filter(velocity: schema.VelocitySensor, names: Sequence[str], dt: float) -> LowPass | None:
    cutoff = values(velocity.cutoff, names)
    for name, frequency in zip(names, cutoff, strict=True):
        if frequency * dt >= 0.5:
            raise SceneError(
                f"scene: 'sensors.velocity.cutoff' = {frequency:g} Hz of joint '{name}'; "
                f"allowed: less than {0.5 / dt:g} Hz, half of the {1.0 / dt:g} samples per second"
            )
    return LowPass(velocity.order, cutoff, dt) if any(cutoff) else None
