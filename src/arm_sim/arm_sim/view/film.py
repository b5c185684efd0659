# SPDX-License-Identifier: Apache-2.0
"""A recorded motion, to be shown: pictures over time, with plots."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.model.arm import ArmModel
from arm_sim.exceptions import ViewError
from arm_sim.recording import Recording
from arm_sim.recording.figure import LONG
from arm_sim.stepping.contact_forces import ContactForce, contact_forces
from arm_sim.view.charts import Chart
from arm_sim.view.marks import Instant, arrows, cones

LOOKS = 4000  # largest number of instants at which forces are computed


@frozen
class Film:
    """An arm's motion.

    Attributes:
        name: Its name on the page.
        model: The arm.
        time: In [s], shape (k,), increasing.
        q: Joint positions in [rad] or [m], shape (k, n).
        stills: Instants at which forces are known, in order of time.
        charts: Plots beside it.

    Raises:
        ViewError: If shapes of times and positions do not match each other or the arm.
    """

    name: str
    model: ArmModel
    time: Array
    q: Array
    stills: tuple[Instant, ...] = ()
    charts: tuple[Chart, ...] = ()

    def __post_init__(self) -> None:
        """Check shapes."""
        if self.q.shape != (len(self.time), self.model.n) or not len(self.time):
            raise ViewError(
                f"{self.name}: positions of shape {self.q.shape} at {len(self.time)} times; an "
                f"arm of {self.model.n} joints needs ({max(len(self.time), 1)}, {self.model.n})"
            )

    def at(self, time: float) -> Instant:
        """The picture at a time: the last state up to then, and the nearest forces."""
        row = max(0, bisect_right(self.time, time + 1e-9) - 1)
        instant = Instant(float(self.time[row]), self.q[row])
        if not self.stills:
            return instant
        i = bisect_right(self.stills, instant.time, key=lambda still: still.time)
        near = self.stills[max(0, i - 1) : i + 1]
        still = min(near, key=lambda still: abs(still.time - instant.time))
        return replace(still, time=instant.time, q=instant.q)


def film_of(recording: Recording, name: str | None) -> Film:
    """The film of a recording, with everything computed in advance.

    Args:
        recording: The run.
        name: Its name on the page; None for that of the robot.
    """
    rows = _looks(len(recording))
    part = recording.part(rows)
    charts = list(_charts(recording, part, rows))
    model = recording.dynamics.model
    called, stills = name or model.pin.name, tuple(_stills(part))
    return Film(called, model, recording.time, recording.q, stills, tuple(charts))


def _stills(part: Recording) -> Iterator[Instant]:
    """Pictures with forces of contacts, constraints and stops, if the scene has any."""
    plant, x = part.plant, part.x
    tied, touching = bool(plant.model.scene.bilateral), bool(plant.points)
    stopped = bool(plant.model.stops.touched(part.q).any())
    if part.of_robot or not (tied or touching or stopped):
        return  # the holding torques of a robot are unknown
    multipliers = part.multipliers if tied else np.zeros((len(part), 0))
    stops = part.stop_torque if stopped else np.zeros_like(part.q)
    for k, time in enumerate(part.time.tolist()):
        forces: tuple[ContactForce, ...] = ()
        if touching:
            stepper = part.account.stepper
            stepper.p[:] = part.p[k]
            forces = contact_forces(plant, stepper, x[k], part.command[k])
        around = cones(forces, plant.model.scene.contacts)
        yield Instant(time, part.q[k], arrows(forces), multipliers[k], stops[k], around)


def _charts(recording: Recording, part: Recording, rows: Array) -> Iterator[Chart]:
    model = recording.dynamics.model
    names, time, slides = model.joint_names, recording.time, "prismatic" in model.joint_types
    for title, values in {
        f"torque [{'N m, N' if slides else 'N m'}]": recording.tau,
        f"position [{'rad, m' if slides else 'rad'}]": recording.q,
        f"speed [{'rad/s, m/s' if slides else 'rad/s'}]": recording.v,
    }.items():
        if np.isfinite(values).any():
            yield Chart(title, names, time, values)
    if recording.of_robot:
        return  # work and heat between its states are unknown
    if recording.local_error.any():
        yield Chart("error [rad]", ("estimated error of q",), time, recording.local_error[:, None])
    curves = {"kinetic": part.kinetic, "potential": part.potential}
    if part.stored.any():
        curves["stored"] = part.stored
    if len(recording) <= LONG or not recording.account.makes_ticks_again(recording.x):
        supplied, lost = recording.supplied[rows], recording.lost[rows]
        curves |= {"supplied": supplied, "lost": lost, "balance": recording.balance[rows]}
    yield Chart("energy [J]", tuple(curves), part.time, np.column_stack(list(curves.values())))


def _looks(count: int) -> Array:
    """Rows of a recording at which forces are computed."""
    return np.unique(np.linspace(0, count - 1, min(count, LOOKS)).astype(int))
