# SPDX-License-Identifier: Apache-2.0
"""A simulation under the hands of a visitor: controlled, pushed, and pulled with the mouse."""

import logging
from enum import StrEnum

import numpy as np

from arm_dynamics.actuation.command_map import CommandMap
from arm_dynamics.arrays import Array
from arm_dynamics.control import GravityCompensation, PDGravity, tuned
from arm_dynamics.exceptions import ArmError
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.trajectory.reference import Reference
from arm_sim.external_wrench import ExternalWrenches
from arm_sim.simulation.energy_meter import EnergyMeter
from arm_sim.simulation.simulator import Simulator
from arm_sim.state import State
from arm_sim.view.charts import Sample
from arm_sim.view.marks import Instant, contacts_of
from arm_sim.view.mouse_pull import PULL, MousePull

ENERGIES = ("kinetic", "potential", "supplied", "lost", "balance", "total")  # the total on top
BANDWIDTH = 4.0  # [rad/s] with which references move to the sliders

_log = logging.getLogger(__name__)


class Mode(StrEnum):
    """What controls an arm, as the page names it."""

    GRAVITY = "gravity compensation"
    SLIDERS = "move to sliders"
    NOTHING = "nothing"


class InteractiveArm:
    """A simulation with its controller, external forces and energies; for one thread.

    Attributes:
        simulation: The simulation.
        wrenches: Pushes.
        mouse: The pull of the mouse.
        damping: 1/T in [1/s] of gravity compensation, by which speeds decay.
        mode: The controller.
        target: Positions of the sliders in [rad] or [m], shape (n,).
    """

    def __init__(self, simulation: Simulator) -> None:
        self.simulation, model = simulation, simulation.model
        simulation.arm.use(simulation.arm.compiled.with_external_torques())
        self.wrenches = ExternalWrenches(simulation.dynamics, "local_world_aligned")
        self._pushed = False
        self._command = CommandMap(model)
        gains = tuned(simulation.dynamics, 20.0, 1.0, dt=simulation.dt)
        self._tracking = PDGravity(simulation.dynamics, *gains)
        self._compensation = GravityCompensation(simulation.dynamics)
        self._rigid = RigidTerms(model)
        self.mouse = MousePull(model, self._rigid)
        # Critical: what the mouse holds, a mass on its spring, does not swing.
        self.damping = 2.0 * np.sqrt(PULL / model.reach)
        try:
            simulation.arm.compiled.energy_account.prepare()
            self._metered = True
        except ArmError as error:
            _log.warning("no energies are known: %s", error)
            self._metered = False
        self.choose(Mode.GRAVITY)
        self._step = 0  # up to which the energies are known
        self._open_account()

    @property
    def error(self) -> Array:
        """Errors from the reference, shape (n,); zeros without a controller."""
        if self.mode != Mode.SLIDERS:
            return np.zeros(self.simulation.n)
        return np.asarray(self._reference[0] - self.simulation.state.q)

    def sample(self) -> Sample:
        """Torques, errors and ``ENERGIES``."""
        energies = np.full(len(ENERGIES), np.nan)
        if self._meter is not None:
            x = self._meter.account()
            flows = x.input + x.changed, x.dissipated, x.balance
            energies = np.array([x.kinetic, x.potential, *flows, x.total])
        return Sample(self.simulation.effort, self.error, energies)

    def instant(self) -> Instant:
        """The picture of the current state, under the torque of the last tick."""
        simulation, scene = self.simulation, self.simulation.model.scene
        return Instant(
            simulation.state.q,
            contacts_of(simulation.model, simulation.contact_forces() if scene.contacts else ()),
            simulation.multipliers() if scene.bilateral else np.zeros(0),
            simulation.stop_torque,
        )

    def choose(self, mode: str) -> None:
        """Choose its controller, by the value of a ``Mode``."""
        q = self.simulation.state.q
        self.mode, self.target = Mode(mode), q.copy()
        self._reference = q.copy(), np.zeros(self.simulation.n)

    def pull(self, frame: str, held: Array, mouse: Array) -> None:
        """Pull a frame where it was seized towards the mouse, both in [m] in the world."""
        self.mouse.pull(self.simulation.state.q, frame, held, mouse)

    def push(self, frame: str, wrench: Array, ticks: int) -> None:
        """Apply a force in [N] and moment in [N m], in world axes, to a frame for some ticks."""
        self.wrenches.push(frame, wrench, self.simulation.state.step + ticks - 1)

    @property
    def external(self) -> Array:
        """Torques of pushes and the pull now, shape (n,)."""
        state = self.simulation.state
        return self.wrenches.advance(state.q, state.step) + self.mouse.torque(state.q)

    def tick(self) -> None:
        """Make a tick."""
        simulation, state = self.simulation, self.simulation.state
        if state.step != self._step:
            self._open_account()  # the state was changed from elsewhere
        if self.wrenches.active or self.mouse.frame or self._pushed:
            simulation.set_parameter("external", self.external)
            self._pushed = bool(self.wrenches.active or self.mouse.frame)
        simulation.arm.advance(self._commanded(state).tolist())
        self._step = state.step + 1
        if self._meter is not None:
            self._meter.note()

    def restart(self) -> None:
        """Reset, without external forces."""
        self.let_go()
        self.simulation.reset()
        self.choose(self.mode)
        self._open_account()

    def let_go(self) -> None:
        """End all external forces."""
        self.wrenches.clear()
        self.mouse.release()
        self.simulation.set_parameter("external", np.zeros(self.simulation.n))
        self._pushed = False

    def place(self, q: Array) -> None:
        """Set its position, at rest."""
        self.simulation.set_state(q, np.zeros(self.simulation.n))
        self.choose(self.mode)
        self._open_account()

    def _open_account(self) -> None:
        self._meter = EnergyMeter(self.simulation.arm) if self._metered else None
        self._step = self.simulation.state.step

    def _commanded(self, state: State) -> Array:
        """The command in a state, by what drives the arm."""
        if self.mode == Mode.NOTHING:
            return np.zeros(self.simulation.n)
        if self.mode == Mode.GRAVITY:
            # D = M(q)/T: every motion decays alike, its energy by exp(-2 t/T), in any posture.
            inertia = self._rigid.mass(state.q)
            torque = self._compensation.torque(state) - self.damping * inertia @ state.v
        else:  # the reference follows the sliders without jumps of its velocity
            q, v = self._reference
            a = BANDWIDTH**2 * (self.target - q) - 2 * BANDWIDTH * v
            v = v + self.simulation.dt * a
            q = q + self.simulation.dt * v
            self._reference = q, v
            torque = self._tracking.torque(state, Reference(q, v, a))
        return np.asarray(self._command(state.q, state.v, torque))
