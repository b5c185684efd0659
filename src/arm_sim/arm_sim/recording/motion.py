# SPDX-License-Identifier: Apache-2.0
"""A recorded motion, and the quantities that follow from it."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics import Dynamics, InvalidInput, Scene
from arm_dynamics.arrays import Array, read_only
from arm_dynamics.attributes import sealed
from arm_sim.figures import units
from arm_sim.imperfections import Measured
from arm_sim.plant.admissible_states import active_constraints
from arm_sim.plant.parameters import CONSTRAINTS, EXTERNAL
from arm_sim.plant.plant import Plant
from arm_sim.recording.contents import BRAKES, Contents
from arm_sim.recording.energy_account import EnergyAccount, relative_error
from arm_sim.recording.physics import Physics
from arm_sim.recording.second_run import NUDGE, WINDOWS, Control, SecondRun, doubt

_log = logging.getLogger(__name__)

# Recorded states that a controller is given again
SAMPLES = 16


@sealed
@dataclass(frozen=True, repr=False)
class RecordedMotion(Contents):
    """A motion, tick by tick, and derived quantities; see ``Contents`` for its arrays.

    Attributes:
        physics: ``Physics`` for derived quantities; None if the scene is unknown.
        control: The controller, if it can be evaluated again.
    """

    physics: Physics | None = None
    control: Control | None = None

    # --- origin --------------------------------------------------------------------------------

    @property
    def scene(self) -> Scene | None:
        """The scene; None if it is unknown."""
        return None if self.origin is None else self.origin.scene

    @property
    def plant(self) -> Plant:
        """The scene's equation of motion."""
        return self._physics.plant

    @property
    def account(self) -> EnergyAccount:
        """Computes the energy account on demand."""
        return self._physics.energy_account

    @property
    def dynamics(self) -> Dynamics:
        """The arm's dynamics at the end of the run."""
        return self._physics.present.with_external(self.p[-1])

    @property
    def _physics(self) -> Physics:
        if self.physics is None:
            raise InvalidInput(
                "the recording has no scene, which this needs; load it with one: "
                "Recording.load(path, scene=…)"
            )
        return self.physics

    # --- derived quantities --------------------------------------------------------------------

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
        x, torque = self.x, np.zeros_like(self.q)
        reactions = self._physics.replay_stepper.reactions
        for k in self._at_stops:
            torque[k] = reactions.of_stops(x[k], self.command[k], self.p[k])
        return read_only(torque)

    @cached_property
    def _at_stops(self) -> Sequence[int]:
        """Times at which a joint is at a stop."""
        return np.flatnonzero(self.plant.model.stops.touched(self.q).any(axis=1)).tolist()

    @cached_property
    def multipliers(self) -> Array:
        """λ of the constraints in [N] and [N m], shape (k+1, m): see ``constrained_forward``."""
        outside, x = self.plant.parameters.place(EXTERNAL), self.x
        tau = np.array(self.plant.joint_torque(x, self.command))
        tau += 0.0 if outside is None else self.p[:, outside]
        if self.plant.eventful and self.plant.constrained:
            reactions = self._physics.replay_stepper.reactions
            for k in self._at_stops if self.plant.free else range(len(self)):
                tau[k] += reactions.beside_bilateral(x[k], self.command[k], self.p[k])
        return _multipliers(self._physics, x, tau, self.p)

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
            braked = self.hold[:-1] == BRAKES
            changed[1:][braked] += (self._energy_before[1:] - self.energy[:-1])[braked]
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
        """Largest unexplained energy, relative to the energy that moved; inf if it is unknown."""
        parts = np.column_stack([self._energies, self.supplied, self.lost, self.changed])
        moved = float(np.ptp(parts, axis=0).sum())
        if len(self) > 1 and self.account.repeats(self.x):
            moved += self.account.turnover(self.x[:-1], self.ended[1:], self.p[:-1])
        balance = float(np.max(abs(self.balance)))
        return relative_error(balance, moved, float(abs(self._energies).max()))

    # --- error ---------------------------------------------------------------------------------

    @cached_property
    def second_run(self) -> SecondRun:
        """All of the motion, run again by other means; about four times the cost of the run.

        Raises:
            InvalidInput: If the motion is of a robot or of no known scene, or not of whole ticks.
        """
        if self.of_robot:
            raise InvalidInput("the error of a motion that was measured is not known")
        steps = np.diff(self.time) / self.account.choice.dt
        if np.delete(abs(steps - 1.0) > 1e-6, [row - 1 for row in self.gaps]).any():
            raise InvalidInput("part of a recording: its error is not known, but that of all is")
        return self._physics.repeater.run(self, self._control)

    @cached_property
    def _control(self) -> Control | None:
        """The controller, unless it has a memory or changes the arm: its answers differ then."""
        last = len(self) - 1
        if self.control is None or self.edges != [0, last]:
            return None
        x = self.x
        for row in np.unique(np.linspace(0, last - 1, SAMPLES, dtype=int)):
            if self.control(x[row], row).tobytes() != self.command[row].tobytes():
                return None
        return self.control

    @cached_property
    def error(self) -> Array:
        """Estimated error of q and v at each time, from ``second_run``, shape (k+1, 2n).

        A controller that is a function is called again, with recorded states and those of the
        second run; one that answers recorded states otherwise is left out of it.

        In [rad] or [m], and [rad/s] or [m/s]; infinite from where that could not go on.
        """
        run, columns = self.second_run, 2 * len(self.joint_names)
        error = run.carried + abs(run.x - self.ended)[:, :columns]
        return read_only(np.where(np.isnan(error), np.inf, error))

    @property
    def trusted(self) -> bool:
        """Whether ``error`` stays below the scene's accuracy; see ``doubt``."""
        return not self.doubt

    @cached_property
    def doubt(self) -> str:
        """Joint, time and, where known, cause of an error beyond the scene's accuracy, else empty.

        The accuracy, ``sim.accuracy``, holds relative to 1 + |x|, and after the first second for
        each second. A difference of velocities counts where it lasts for two ticks: an event that
        ends a tick is in one run before that, and in the other after it. A doubt is logged once.
        """
        text = doubt(self, self.second_run, self.error, self._magnification)
        if text:
            _log.warning("%s", text)
        return text

    @property
    def verdict(self) -> str:
        """The largest error, or the doubt, in a sentence."""
        if self.doubt:
            return self.doubt
        n, run = len(self.joint_names), self.second_run
        largest = float(self.error[:, :n].max(initial=0.0))
        unit = units(self.plant.model.joint_types, "rad", "m", " or ")
        rounded = largest <= np.finfo(float).eps * max(1.0, abs(self.q).max(initial=0.0))
        bound = "rounding" if rounded else f"{largest:.1g} {unit}"
        return f"accurate to {bound}, by a second run {run.how} ({run.means})"

    def _magnification(self, row: int) -> float:
        """Factor by which a change of the start has grown at a row; 1 with windows."""
        run = self.second_run
        if run.how == WINDOWS:
            return 1.0
        nudged = self._physics.repeater.run(self, self._control, NUDGE)
        n = len(self.joint_names)
        return float(np.nanmax(abs(nudged.x - run.x)[: row + 1, :n], initial=0.0) / NUDGE)

    def part(self, rows: ArrayLike) -> Self:
        """Select some of its states.

        Quantities between states, such as work and heat, are not available of the part.

        Args:
            rows: Indices of the states, shape (k,), or a mask of all of them.
        """
        selection = np.asarray(rows if np.size(rows) else np.zeros(0, dtype=int))
        count, mask = len(self.time), selection.dtype == bool
        valid = selection.ndim == 1 and selection.dtype.kind in "iub"
        if not valid or (mask and len(selection) != count):
            raise InvalidInput(f"rows = {rows!r}; indices or a mask of {count} are expected")
        indices = np.flatnonzero(selection) if mask else selection
        if len(indices) and not -count <= indices.min() <= indices.max() < count:
            raise InvalidInput(
                f"rows from {indices.min()} to {indices.max()}; the recording has {count} states"
            )
        names = ("time", "q", "v", "z", "command", "local_error", "time_stepped", "p")
        arrays: dict[str, Any] = {name: read_only(getattr(self, name)[indices]) for name in names}
        hold = None if self.hold is None else self.hold[indices]
        x = self.measured
        measured = x and Measured.of(np.hstack([x.q, x.v, x.effort])[indices])
        return replace(self, **arrays, hold=hold, jumps=(), gaps=(), measured=measured)

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


def _multipliers(physics: Physics, x: Array, tau: Array, p: Array) -> Array:
    """λ of the constraints at states, as ``Dynamics.constrained_forward`` has them.

    Args:
        physics: The equations of the scene.
        x: States, shape (k, nx).
        tau: Torques on the joints, friction at rest included, in [N m] or [N], shape (k, n).
        p: Tunable quantities at each state, shape (k, np).

    Returns:
        In [N] and [N m], shape (k, m); zero for constraints that are switched off there.
    """
    plant, present = physics.plant, physics.present
    n = plant.model.n
    multipliers = np.zeros(
        (len(x), present.without_external(plant.parameters.nominal).constrained.m)
    )
    for run in present.runs(p, CONSTRAINTS):
        constrained = present.without_external(p[run.start]).constrained
        names = active_constraints(plant, p[run.start])
        q, v = x[run, :n], x[run, n : 2 * n]
        multipliers[run] = constrained.without_sticking(q, v, tau[run], names)[1]
    return multipliers
