# SPDX-License-Identifier: Apache-2.0
"""The recording of a run."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics import Dynamics, InvalidInput, Scene
from arm_dynamics.arrays import Array, read_only
from arm_dynamics.exceptions import known_names
from arm_sim.plant.plant import Plant
from arm_sim.recording.contents import BRAKES, FREE, Contents
from arm_sim.recording.energy_account import TRUSTED, EnergyAccount, relative_error
from arm_sim.recording.figure import draw
from arm_sim.recording.measured import with_scene
from arm_sim.recording.origin import Physics
from arm_sim.recording.second_look import SecondLook, Ticks, second_look
from arm_sim.recording.tables import columns, to_pandas, to_xarray

_log = logging.getLogger(__name__)


@dataclass(frozen=True, repr=False)
class Recording(Contents):
    """A motion, tick by tick, and derived quantities; see ``Contents`` for its arrays.

    Attributes:
        physics: The equations for derived quantities; None if the scene is unknown.
    """

    physics: Physics | None = None

    # --- files ---------------------------------------------------------------------------------

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write a file that ``load`` opens anywhere: scene and robot description are in it.

        Args:
            path: ``.npz`` for NumPy; ``.mcap`` for ``ros2 bag``, PlotJuggler and Foxglove; without
                suffix a folder, as ``ros2 bag record`` creates it. Existing files are replaced.

        Returns:
            Path of the file or folder.

        Raises:
            InvalidInput: If the suffix is not supported, or the motion is not of a scene.
            OSError: If it cannot be written.
        """
        from arm_sim.recording import files  # imports libraries that a run does not require

        return files.save(self, path, lambda: self.tau)

    @classmethod
    def load(
        cls, path: str | os.PathLike[str], scene: Any = None, *, topic: str | None = None
    ) -> Self:
        """Read a recording: one of ours, a bag of a robot, or a table.

        Args:
            path: A file of ``save``; a bag of ROS 2 (``.mcap``, ``.db3`` or a folder of them) with
                joint states; or a ``.csv`` with columns ``time`` and ``position.NAME``,
                ``velocity.NAME``, ``effort.NAME``.
            scene: For a recording without one: anything ``load_scene`` accepts.
            topic: Topic of the joint states, if a bag has several.

        Raises:
            NoRecording: If it does not exist.
            InvalidInput: If it is not a recording, or too damaged to be used.
            SceneError: If the scene cannot be used or is of another robot.
            OSError: If it cannot be read.
        """
        from arm_sim.recording import files

        loaded = cls._made(files.load(path, topic))
        return loaded if scene is None else loaded.of(scene)

    def of(self, scene: Any) -> Self:
        """A recording without a scene, combined with a scene and restricted to its joints.

        Raises:
            SceneError: If the scene cannot be used, or is of another robot.
        """
        return self._made(with_scene(self, scene))

    @classmethod
    def _made(cls, contents: Contents) -> Self:
        physics = None if contents.origin is None else Physics(contents.origin)
        return cls(**contents.fields(), physics=physics)

    def to_dict(self) -> dict[str, Array]:
        """Columns by name, each of shape (k+1,), such as ``time`` and ``position.elbow``.

        Positions, velocities, efforts (torques on the joints), commands of joints with drives, and
        internal states.
        """
        return columns(self)

    def to_pandas(self) -> Any:
        """A ``pandas.DataFrame`` of ``to_dict``, by time.

        Raises:
            InvalidInput: If pandas is not installed.
        """
        return to_pandas(self)

    def to_xarray(self) -> Any:
        """An ``xarray.Dataset`` by time and joint, with units.

        Raises:
            InvalidInput: If xarray is not installed.
        """
        return to_xarray(self)

    def plot(self, *others: Recording, joints: Sequence[str] = ()) -> Any:
        """Draw positions, velocities, torques and the energy account.

        Args:
            *others: Recordings to draw over this one, dashed.
            joints: Joints to draw; all if none is named.

        Returns:
            A ``matplotlib.figure.Figure``.

        Raises:
            InvalidInput: If a joint is unknown, or recordings share none.
        """
        return draw((self, *others), joints)

    # --- origin --------------------------------------------------------------------------------

    @property
    def scene(self) -> Scene | None:
        """The scene; None if it is unknown."""
        return None if self.origin is None else self.origin.scene

    @property
    def plant(self) -> Plant:
        """The scene's equation of motion."""
        return self._known.plant

    @property
    def account(self) -> EnergyAccount:
        """Computes the energy account on demand."""
        return self._known.account

    @property
    def dynamics(self) -> Dynamics:
        """The arm's dynamics at the end of the run."""
        return self._known.present.tuned(self.p[-1])

    @property
    def _known(self) -> Physics:
        if self.physics is None:
            raise InvalidInput(
                "the recording has no scene, which this needs; load it with one: "
                "Recording.load(path, scene=…)"
            )
        return self.physics

    # --- derived quantities --------------------------------------------------------------------

    def __len__(self) -> int:
        """Number of recorded states."""
        return len(self.time)

    @cached_property
    def tau(self) -> Array:
        """Torques that act on the joints from each time in [N m] or [N], shape (k+1, n).

        The command, or the torque of a joint's drive at the end of the tick; of a robot its
        measured effort.
        """
        if self.of_robot:
            return self.command
        after = np.vstack([self.ended[1:], self.x[-1:]])
        return read_only(self.plant.joint_torque(after, self.command))

    @cached_property
    def _energies(self) -> Array:
        return self.account.energies(self.x, self.p)

    @property
    def kinetic(self) -> Array:
        """Kinetic energy in [J], shape (k+1,)."""
        return self._energies[:, 0]

    @property
    def potential(self) -> Array:
        """Potential energy of gravity and springs in [J], shape (k+1,)."""
        return self._energies[:, 1]

    @property
    def stored(self) -> Array:
        """Stored energy in [J], shape (k+1,): flexible drives, inductances, bristles."""
        return self._energies[:, 2]

    @cached_property
    def energy(self) -> Array:
        """Kinetic, potential and stored energy in [J], shape (k+1,)."""
        return self.kinetic + self.potential + self.stored

    @property
    def supplied(self) -> Array:
        """Work supplied up to each time in [J], shape (k+1,), by torque or voltage."""
        return self._flows[:, 0]

    @property
    def lost(self) -> Array:
        """Heat lost up to each time in [J], shape (k+1,): friction, windings, damping."""
        return self._flows[:, 1]

    @cached_property
    def stop_torque(self) -> Array:
        """Torques of the stops on the joints from each time in [N m] or [N], (k+1, n).

        See ``Simulator.stop_torque``.
        """
        stepper, x, torque = self.account.stepper, self.x, np.zeros_like(self.q)
        for k in self._at_stops:
            stepper.p[:] = self.p[k]
            torque[k] = stepper.stop_torque(x[k], self.command[k])
        return read_only(torque)

    @cached_property
    def _at_stops(self) -> Sequence[int]:
        """Times at which a joint is at a stop."""
        return np.flatnonzero(self.plant.model.stops.touched(self.q).any(axis=1)).tolist()

    @cached_property
    def multipliers(self) -> Array:
        """λ of the constraints in [N] and [N m], shape (k+1, m): see ``constrained_forward``."""
        outside, x = self.plant.parameters.place("external"), self.x
        tau = np.array(self.plant.joint_torque(x, self.command))
        tau += 0.0 if outside is None else self.p[:, outside]
        if self.plant.eventful and self.plant.constrained:
            stepper = self.account.stepper
            for k in self._at_stops if self.plant.free else range(len(self)):
                stepper.p[:] = self.p[k]
                tau[k] += stepper.push(x[k], self.command[k])
        return self.account.multipliers(x, tau, self.p)

    @cached_property
    def balance(self) -> Array:
        """Unexplained energy in [J], shape (k+1,): E - E(0) - supplied - changed + lost."""
        start = self.energy[0] - self.changed[0]
        balance: Array = self.energy - start - self.supplied - self.changed + self.lost
        return balance

    @cached_property
    def changed(self) -> Array:
        """Energy added by changes between ticks up to each time in [J], shape (k+1,).

        Changes of payload, gravity or friction, by ``set_parameter`` and similar methods, and of
        the state, by ``set_state`` and ``set_constraint``, during the run.
        """
        changed = self.energy - self._energy_before
        if self.hold is not None:  # brakes absorb the kinetic energy
            taken = self.hold[:-1] == BRAKES
            changed[1:][taken] += (self._energy_before[1:] - self.energy[:-1])[taken]
        return np.cumsum(changed)

    @cached_property
    def _energy_before(self) -> Array:
        """Energy at each time before changes between ticks in [J], shape (k+1,)."""
        before = self.energy.copy()
        for row in self.gaps:
            before[row] = self.energy[row - 1]
        for jump in self.first_jumps:
            before[jump.row] = self.account.energies(jump.x[None], jump.p[None]).sum()
        return before

    @cached_property
    def energy_error(self) -> float:
        """Largest unexplained energy, relative to the energy that moved; inf if it is unknown.

        Above 1e-3 the motion cannot be trusted: a warning is logged once for each recording.
        """
        parts = np.column_stack([self._energies, self.supplied, self.lost, self.changed])
        moved = float(np.ptp(parts, axis=0).sum()) + self._turnover
        balance = float(np.max(abs(self.balance)))
        error = relative_error(balance, moved, float(abs(self._energies).max()))
        if error > TRUSTED:
            _log.warning("%s; a smaller dt or a tolerance is expected", self._verdict(error))
        return error

    @cached_property
    def _turnover(self) -> float:
        if not self._made_again:
            return 0.0
        return self.account.turnover(self.x[:-1], self.ended[1:], self.p[:-1])

    @property
    def _made_again(self) -> bool:
        return len(self) > 1 and self.account.makes_ticks_again(self.x)

    @property
    def trusted(self) -> bool:
        """Whether the energy account is closed, and a second look agrees; see ``trust``."""
        return self.trust()

    def trust(self, *, second_look: bool = True) -> bool:
        """Whether the motion can be trusted.

        Args:
            second_look: Whether some of its ticks are made again, see ``second_look``.

        Returns:
            Whether the error of the energy account is at most 1e-3 of the energy that moved, and
            the ticks that were made again agree.
        """
        return self.energy_error <= TRUSTED and not (second_look and self.doubt)

    @cached_property
    def second_look(self) -> SecondLook:
        """Some ticks of the motion, made again with half the step."""
        usable = np.ones(max(len(self) - 1, 0), dtype=bool)
        usable &= np.diff(self.time_stepped) == 0
        usable[[row - 1 for row in self.gaps]] = False
        if self.hold is not None:
            usable &= self.hold[:-1] == FREE
        motion = Ticks(
            self.x[:-1], self.ended[1:], self.command[:-1], self.p[:-1], np.diff(self.error)
        )
        account = self.account
        return second_look(
            motion,
            usable,
            account.choice,
            lambda ticks: account.made_finer(ticks.x, ticks.u, ticks.p),
        )

    @cached_property
    def doubt(self) -> str:
        """What the second look found, as text; empty if it agrees. A warning is logged once."""
        look = self.second_look
        if look.agrees:
            return ""
        worst = look.worst
        text = (
            f"not trustworthy: the tick at {self.time[look.ticks[worst]]:.9g} s, made again with "
            f"half the step, ends elsewhere: joint '{self.joint_names[look.joint[worst]]}' by "
            f"{look.difference[worst]:.2g} of 1 + |q|, allowed {look.allowed[worst]:.2g}"
        )
        _log.warning("%s; a smaller dt or a tolerance is expected", text)
        return text

    def __repr__(self) -> str:
        """A summary: duration, origin, events, and the error of the energy account.

        The energy account is computed here only if no tick must be repeated for it.
        """
        span = f"{self.time[0]:g} to {self.time[-1]:g} s" if len(self) else "empty"
        joints = f"{len(self.joint_names)} joints: {known_names(self.joint_names, 8)}"
        lines = [f"{max(len(self) - 1, 0)} ticks, {span}", joints, *self._origin_texts()]
        for count, what in (
            (len(self.jumps), "changes between ticks"), (len(self.events), "events"),
            (len(self.gaps), "gaps: ticks are missing"),
        ):  # fmt: skip
            if count:
                lines.append(f"{count} {what}")
        return "<Recording: " + "\n  ".join(lines) + ">"

    def _origin_texts(self) -> list[str]:
        """Origin, and error of the energy account, as text."""
        if self.of_robot:
            return ["measured: without a scene" if self.origin is None else "measured"]
        if self.origin is None or self.physics is None:
            return ["without a scene"]
        origin = self.origin
        control = "" if origin.tolerance is None else f", tolerance {origin.tolerance:g}"
        source = f" of {origin.source}" if origin.source else ""
        method = f"{origin.integrator}, dt {origin.dt:g} s{control}{source}"
        fresh = "account" in vars(self.physics)
        cheap = fresh and not self.account.makes_ticks_again(self.x)
        known = "energy_error" in vars(self) or cheap
        told = self._verdict(self.energy_error) if known else "energy account not evaluated yet"
        return [method, told]

    @staticmethod
    def _verdict(error: float) -> str:
        if error <= TRUSTED:
            return f"energy account closed to {error:.2g} of the energy that moved"
        return (
            f"not trustworthy: the energy account is off by {error:.2g} of the energy that "
            f"moved, more than {TRUSTED:g}"
        )

    def part(self, rows: ArrayLike) -> Recording:
        """Select some of its states.

        Quantities between states, such as work and heat, are not available of the part.

        Args:
            rows: Indices of the states, shape (k,).
        """
        here = np.asarray(rows)
        states = ("time", "q", "v", "z", "command", "error", "time_stepped", "p")
        chosen: dict[str, Any] = {name: read_only(getattr(self, name)[here]) for name in states}
        hold = None if self.hold is None else self.hold[here]
        return replace(self, **chosen, hold=hold, jumps=(), gaps=(), measured=None)

    @cached_property
    def _flows(self) -> Array:
        if self.of_robot:
            raise InvalidInput(
                "supplied work and lost heat between measured states are unknown; a recording "
                "of a robot there are kinetic, potential and stored energy only"
            )
        flows = self.account.flows(self.x[:-1], self.ended[1:], self.command[:-1], self.p[:-1])
        flows[~self.moved] = 0.0
        return np.vstack([np.zeros(2), np.cumsum(flows, axis=0)])
