# SPDX-License-Identifier: Apache-2.0
"""State of a simulation at the end of a tick."""

from __future__ import annotations

from dataclasses import dataclass

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed


def read_only_view(x: Array) -> Array:
    """A read-only view of numbers."""
    view = x.view()
    view.setflags(write=False)
    return view


@sealed
@dataclass(frozen=True, slots=True)
class State:
    """State of the robot; arrays are read-only.

    Attributes:
        time: ``step * dt`` in [s], never accumulated.
        step: Ticks since the last reset.
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities in [rad/s] or [m/s], shape (n,).
        z: Internal states of drives and friction, shape (nz,).
        error: Estimated error of q since the last reset in [rad] or [m]; 0 if the method has none.
        time_stepped: Number of ticks since the last reset with so many events that the rest of
            the tick was time-stepped at first order.
    """

    _instead = {"time step q v z qd position velocity": "Simulator.set_state(q=…, v=…) sets it"}

    time: float
    step: int
    q: Array
    v: Array
    z: Array
    error: float = 0.0
    time_stepped: int = 0

    @classmethod
    def of(
        cls, x: Array, n: int, step: int, dt: float, error: float, time_stepped: float = 0.0
    ) -> State:
        """From x = (q, v, z), which is copied, after ``step`` ticks of ``dt`` in [s]."""
        x = read_only_view(x.copy())
        q, v, z = x[:n], x[n : 2 * n], x[2 * n :]
        return cls(step * dt, step, q, v, z, error, int(time_stepped))
