# SPDX-License-Identifier: Apache-2.0
"""A recording as a film: pictures over time, with plots."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.arrays import Array
from arm_sim.plant.plant import Plant
from arm_sim.recording.energy_account import EnergyAccount
from arm_sim.stepping.contact_forces import contact_forces
from arm_sim.view import Chart, Film, Instant, looks

LONG = 50_000  # largest number of ticks that the energy account repeats for a chart


class Recorded(Protocol):
    """The parts of a recording that are shown; a ``Recording`` has them."""

    @property
    def time(self) -> Array:
        """In [s], shape (k,)."""

    @property
    def q(self) -> Array:
        """Positions, shape (k, n)."""

    @property
    def v(self) -> Array:
        """Velocities, shape (k, n)."""

    @property
    def x(self) -> Array:
        """States, shape (k, nx)."""

    @property
    def command(self) -> Array:
        """Commands, shape (k, n)."""

    @property
    def error(self) -> Array:
        """Estimated error of q, shape (k,)."""

    @property
    def p(self) -> Array:
        """Tunable quantities, shape (k, np)."""

    @property
    def dynamics(self) -> Dynamics:
        """The arm's dynamics."""

    @property
    def plant(self) -> Plant:
        """Its equation of motion."""

    @property
    def of_robot(self) -> bool:
        """Whether it is of a robot, not of our own ticks."""

    @property
    def account(self) -> EnergyAccount:
        """Computes the energy account."""

    def __len__(self) -> int:
        """Number of states."""

    def part(self, rows: Array) -> Recorded:
        """The selected states."""

    @property
    def tau(self) -> Array:
        """Torques, shape (k, n)."""

    @property
    def kinetic(self) -> Array:
        """Kinetic energy, shape (k,)."""

    @property
    def potential(self) -> Array:
        """Potential energy, shape (k,)."""

    @property
    def stored(self) -> Array:
        """Stored energy of drives and friction, shape (k,)."""

    @property
    def supplied(self) -> Array:
        """Work supplied, shape (k,)."""

    @property
    def lost(self) -> Array:
        """Heat lost, shape (k,)."""

    @property
    def balance(self) -> Array:
        """Unexplained energy, shape (k,)."""

    @property
    def multipliers(self) -> Array:
        """Forces of constraints, shape (k, m)."""

    @property
    def stop_torque(self) -> Array:
        """Torques of stops, shape (k, n)."""


def film_of(recording: Recorded, name: str) -> Film:
    """The film of a recording, with everything computed in advance.

    Args:
        recording: The run.
        name: Its name on the page.
    """
    rows = looks(len(recording))
    part = recording.part(rows)
    charts = list(_charts(recording, part, rows))
    model = recording.dynamics.model
    return Film(name, model, recording.time, recording.q, tuple(_stills(part)), tuple(charts))


def _stills(part: Recorded) -> Iterator[Instant]:
    """Pictures with forces of contacts, constraints and stops, if the scene has any."""
    plant, x = part.plant, part.x
    tied, touching = bool(plant.model.scene.bilateral), plant.contact is not None
    stopped = bool(plant.model.stops.touched(part.q).any())
    if part.of_robot or not (tied or touching or stopped):
        return  # the holding torques of a robot are unknown
    nothing = np.zeros((len(part), 0))
    multipliers = part.multipliers if tied else nothing
    stops = part.stop_torque if stopped else np.zeros_like(part.q)
    for k, time in enumerate(part.time.tolist()):
        contacts = np.zeros((0, 2, 3))
        if touching:
            stepper = part.account.stepper
            stepper.p[:] = part.p[k]
            forces = contact_forces(plant, stepper, x[k], part.command[k])
            contacts = np.array([[force.point, force.force] for force in forces])
        yield Instant(time, part.q[k], contacts, multipliers[k], stops[k])


def _charts(recording: Recorded, part: Recorded, rows: Array) -> Iterator[Chart]:
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
    if recording.error.any():
        yield Chart("error [rad]", ("estimated error of q",), time, recording.error[:, None])
    curves = {"kinetic": part.kinetic, "potential": part.potential}
    if part.stored.any():
        curves["stored"] = part.stored
    if len(recording) <= LONG or not recording.account.makes_ticks_again(recording.x):
        supplied, lost = recording.supplied[rows], recording.lost[rows]
        curves |= {"supplied": supplied, "lost": lost, "balance": recording.balance[rows]}
    yield Chart("energy [J]", tuple(curves), part.time, np.column_stack(list(curves.values())))
