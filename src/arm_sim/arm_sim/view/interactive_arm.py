# SPDX-License-Identifier: Apache-2.0
"""A simulation under the hands of a visitor: controlled, pushed, and pulled with the mouse."""

from __future__ import annotations

import logging
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from arm_dynamics.actuation.command_map import CommandMap
from arm_dynamics.arrays import Array
from arm_dynamics.control.joint_space import GravityCompensation, PDGravity, tuned
from arm_dynamics.exceptions import ArmError
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.trajectory.reference import Reference
from arm_sim.external_wrench import ExternalWrenches
from arm_sim.simulation.energy_meter import EnergyMeter
from arm_sim.simulation.simulator import Simulator
from arm_sim.state import State
from arm_sim.view.charts import Sample
from arm_sim.view.marks import Instant, contacts_of

ENERGIES = ("kinetic", "potential", "supplied", "lost", "balance", "total")  # the total on top
BANDWIDTH = 4.0  # [rad/s] with which references move to the sliders
PULL = 2.0 * 9.81  # [m/s²] by which the mouse accelerates what it holds from one reach away

_log = logging.getLogger(__name__)


class Mode(StrEnum):
    """What controls an arm, as the page names it."""

    GRAVITY = "gravity compensation"
    SLIDERS = "move to sliders"
    NOTHING = "nothing"


class _Pull(NamedTuple):
    """Of the mouse at a frame."""

    frame: str
    point: Array  # that is held, in the frame, homogeneous, shape (4,)
    mouse: Array  # its place in the world, shape (3,)


class InteractiveArm:
    """A simulation with its controller, external forces and energies; for one thread."""

    _step: int  # up to which the energies are known

    def __init__(self, simulation: Simulator) -> None:
        self.simulation, model = simulation, simulation.model
        simulation.arm.use(simulation.arm.compiled.pushable())
        self.wrenches = ExternalWrenches(simulation.dynamics, "local_world_aligned")
        self._pushed = False
        self._pull: _Pull | None = None
        self._command = CommandMap(model)
        gains = tuned(simulation.dynamics, 20.0, 1.0, dt=simulation.dt)
        self._tracking = PDGravity(simulation.dynamics, *gains)
        self._compensation = GravityCompensation(simulation.dynamics)
        self._rigid = RigidTerms(model)
        # 1/T in [1/s] of gravity compensation, by which speeds decay; critical: what the mouse
        # holds, a mass on its spring, does not swing.
        self.damping = 2.0 * np.sqrt(PULL / model.reach)
        try:
            simulation.arm.compiled.energy_account.prepare()
            self._metered = True
        except ArmError as error:
            _log.warning("no energies are known: %s", error)
            self._metered = False
        self.mode, self.target = Mode.GRAVITY, simulation.state.q.copy()
        self._reference = self.target.copy(), np.zeros(simulation.n)
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

    def push(self, frame: str, wrench: Array, ticks: int) -> None:
        """Apply a force in [N] and moment in [N m], in world axes, to a frame for some ticks."""
        self.wrenches.push(frame, wrench, self.simulation.state.step + ticks - 1)

    def pull(self, frame: str, held: Array, mouse: Array) -> None:
        """Pull a frame where it is seized, in [m], towards the mouse, as by a spring."""
        if self._pull is None or self._pull.frame != frame:
            pose = self.simulation.dynamics.pose(self.simulation.state.q, frame)
            point = np.linalg.solve(pose, np.append(held, 1.0))
        else:
            point = self._pull.point
        self._pull = _Pull(frame, point, mouse)

    def release(self) -> None:
        """End the pull."""
        self._pull = None

    @property
    def external(self) -> Array:
        """Torques of pushes and the pull now, shape (n,)."""
        q, step = self.simulation.state.q, self.simulation.state.step
        torque = self.wrenches.torque(q, step)
        return torque if self._pull is None else torque + self._pulled(q, *self._pull)

    def _pulled(self, q: Array, frame: str, point: Array, mouse: Array) -> Array:
        """Torque of the pull, which accelerates what is held alike, be it light or heavy.

        A force along u meets the mass 1/(uᵀ J M⁻¹ Jᵀ u) (Khatib, "Inertial properties in robotic
        manipulation", Int. J. Robotics Research 14(1), 1995); near singularities, that of the arm.
        """
        dynamics = self.simulation.dynamics
        pose, J = dynamics.pose(q, frame), dynamics.jacobian(q, frame)
        held = pose @ point
        way = mouse - held[:3]
        turned = np.append(way, np.cross(held[:3] - pose[:3, 3], way)) @ J
        ease = turned @ self._rigid.mobility(q) @ turned
        whole = dynamics.model.total_mass
        mass = way @ way / ease if whole * ease > way @ way else whole
        return np.asarray(PULL * mass / dynamics.model.reach * turned)

    def tick(self) -> None:
        """Make a tick."""
        simulation, state = self.simulation, self.simulation.state
        if state.step != self._step:
            self._open_account()  # the state was changed from elsewhere
        if self.wrenches.active or self._pull or self._pushed:
            simulation.set_parameter("external", self.external)
            self._pushed = bool(self.wrenches.active or self._pull)
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
        self.release()
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
