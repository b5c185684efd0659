# SPDX-License-Identifier: Apache-2.0
"""Interactive simulations: run, pause, step, reset, place, push and pull."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_dynamics.actuation.command_map import CommandMap
from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed
from arm_dynamics.control.joint_space import GravityCompensation, PDGravity, tuned
from arm_dynamics.exceptions import ArmError
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.trajectory.reference import Reference
from arm_sim.external_wrench import ExternalWrenches
from arm_sim.simulation.energy_meter import EnergyMeter
from arm_sim.simulation.simulator import Simulator
from arm_sim.state import State
from arm_sim.view.charts import RollingCharts, Sample
from arm_sim.view.drawn_arm import MOUSE, DrawnArm
from arm_sim.view.marks import Instant, contacts_of
from arm_sim.view.page import View

if TYPE_CHECKING:
    import viser

NOTHING, WEIGHT, SLIDERS = "nothing", "gravity compensation", "move to sliders"
CONTROLS = (WEIGHT, SLIDERS, NOTHING)
SPEEDS = ("0.05", "0.1", "0.25", "0.5", "1", "2")
ENERGIES = ("kinetic", "potential", "total", "supplied", "lost", "balance")
BUDGET = 0.025  # [s] of real time that ticks may take between two frames
MEMORY = 10.0  # [s] that curves go back
SAMPLED = 0.02  # [s] between points of curves, in simulated time
CHARTED = 0.25  # [s] between drawings of curves
BANDWIDTH = 4.0  # [rad/s] with which references move to the sliders
UNLIMITED = {"prismatic": 1.0}  # half the range of a slider without limits in [m]; others: π
DECIMALS, STEPS = 3, 30  # of a slider, whose box is narrow: more decimals only for so many steps
PULL = 2.0 * 9.81  # [m/s²] by which the mouse accelerates what it holds from one reach away

_log = logging.getLogger(__name__)


class InteractiveArm:
    """A simulation with its controller, external forces and energies; for one thread."""

    _step: int  # up to which the energies are known

    def __init__(self, simulation: Simulator) -> None:
        self.simulation, model = simulation, simulation.model
        simulation.arm.use(simulation.arm.compiled.pushable())
        self.wrenches = ExternalWrenches(simulation.dynamics, "local_world_aligned")
        self._pushed = False
        # Frame, point of it, place of the mouse.
        self._pull: tuple[str, Array, Array] | None = None
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
        self.control, self.target = WEIGHT, simulation.state.q.copy()
        self._reference = self.target.copy(), np.zeros(simulation.n)
        self._open_account()

    @property
    def error(self) -> Array:
        """Errors from the reference, shape (n,); zeros without a controller."""
        if self.control != SLIDERS:
            return np.zeros(self.simulation.n)
        return np.asarray(self._reference[0] - self.simulation.state.q)

    def sample(self) -> Sample:
        """Torques, errors and ``ENERGIES``."""
        energies = np.full(len(ENERGIES), np.nan)
        if self._meter is not None:
            x = self._meter.account()
            flows = x.input + x.changed, x.dissipated, x.balance
            energies = np.array([x.kinetic, x.potential, x.total, *flows])
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

    def choose(self, control: str) -> None:
        """Choose its controller."""
        q = self.simulation.state.q
        self.control, self.target = control, q.copy()
        self._reference = q.copy(), np.zeros(self.simulation.n)

    def push(self, frame: str, wrench: Array, ticks: int) -> None:
        """Apply a force in [N] and moment in [N m], in world axes, to a frame for some ticks."""
        self.wrenches.push(frame, wrench, self.simulation.state.step + ticks - 1)

    def pull(self, frame: str, held: Array, mouse: Array) -> None:
        """Pull a frame where it is seized, in [m], towards the mouse, as by a spring."""
        if self._pull is None or self._pull[0] != frame:
            pose = self.simulation.dynamics.pose(self.simulation.state.q, frame)
            point = np.linalg.solve(pose, np.append(held, 1.0))
        else:
            point = self._pull[1]
        self._pull = frame, point, mouse

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
        self.choose(self.control)
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
        self.choose(self.control)
        self._open_account()

    def _open_account(self) -> None:
        self._meter = EnergyMeter(self.simulation.arm) if self._metered else None
        self._step = self.simulation.state.step

    def _commanded(self, state: State) -> Array:
        if self.control == NOTHING:
            return np.zeros(self.simulation.n)
        if self.control == WEIGHT:
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


@sealed
class Interactive(View):
    """A page of simulations, which share a clock."""

    running: bool

    def __init__(
        self, server: viser.ViserServer, actors: Sequence[DrawnArm],
        rigs: Sequence[InteractiveArm],
    ) -> None:  # fmt: skip
        super().__init__(server, actors)
        self.rigs, self._pairs = tuple(rigs), tuple(zip(rigs, actors, strict=True))
        self.running, self._backlog, self._message = False, 0.0, ""
        self._dt = max(rig.simulation.dt for rig in rigs)
        self._add_buttons(server.gui)
        self._sliders = [self._add_sliders(*pair) for pair in self._pairs]
        for rig, actor in self._pairs:
            model = rig.simulation.model
            frames = [name for name in model.frame_names if model.frame(name).parentJoint > 0]
            self._add_push(rig, actor, frames)
            for frame, link in actor.links:
                if frame in frames:
                    link.on_drag(partial(self._drag, rig, actor, frame))
        joints = {actor.name: rig.simulation.joint_names for rig, actor in self._pairs}
        self._charts = RollingCharts(server, joints, ENERGIES, MEMORY, SAMPLED)
        self.draw()

    def close(self) -> None:
        """End the page, and what it pushes with."""
        super().close()
        for rig in self.rigs:
            rig.let_go()

    def draw(self) -> None:
        """Draw the current state of the arms."""
        with self._server.atomic():
            for rig, actor in self._pairs:
                actor.draw(rig.instant(), leave_path=True)
        for rig, sliders in zip(self.rigs, self._sliders, strict=True):
            if rig.control != SLIDERS:
                model, q = rig.simulation.model, rig.simulation.state.q
                for i, slider in enumerate(sliders):
                    slider.min, slider.max, _, slider.value = slider_of(model, i, q[i])
        now = self.rigs[0].simulation.state.time
        going = f"running at {self._speed.value} ×" if self.running else "paused"
        trouble = f"\n\n**{self._message}**" if self._message else ""
        self._status.content = f"t = {now:.3f} s, {going}{trouble}"
        self._charts.draw(CHARTED if self.running else 0.0)

    # --- orders: for the thread of the page ---------------------------------------------------

    def run(self, on: bool) -> None:
        """Run or pause."""
        self.running, self._backlog, self._message = on, 0.0, ""
        self._run_button.label = "Pause" if on else "Run"
        self.draw()

    def step(self, ticks: int) -> None:
        """Advance by some ticks."""
        self.run(False)
        for _ in range(ticks):
            self._tick()
        self.draw()

    def reset(self) -> None:
        """Reset to time zero."""
        self.run(False)
        for rig, actor in self._pairs:
            rig.restart()
            actor.clear_path()
            self._charts.clear(actor.name)
        self.draw()

    def choose(self, control: str) -> None:
        """Choose the controller of all arms."""
        for rig in self.rigs:
            rig.choose(control)
        self.draw()

    def slide(self, rig: InteractiveArm, joint: int, value: float) -> None:
        """Move an arm to the position of a slider, or set it there while paused."""
        if rig.control == SLIDERS:
            rig.target[joint] = value
        elif not self.running:
            q = rig.simulation.state.q.copy()
            q[joint] = value
            rig.place(q)
            self.draw()

    def _update(self, passed: float) -> None:
        if not self.running:
            return
        self._backlog = min(self._backlog + passed * float(self._speed.value), 0.25)
        until = time.monotonic() + BUDGET
        while self._backlog >= self._dt and time.monotonic() < until:
            self._backlog -= self._dt
            self._tick()
        self.draw()

    def _tick(self) -> None:
        """Advance all arms by the longest of their ticks."""
        for rig, actor in self._pairs:
            for _ in range(round(self._dt / rig.simulation.dt)):
                rig.tick()
            self._charts.add(actor.name, rig.simulation.state.time, rig.sample)

    def _report(self, trouble: str) -> None:
        self.run(False)
        self._message = trouble
        self.draw()

    # --- controls -----------------------------------------------------------------------------

    def _add_buttons(self, gui: viser.GuiApi) -> None:
        """Add what runs and controls all arms."""
        self._run_button = gui.add_button("Run")
        self._run_button.on_click(lambda _: self._order(lambda: self.run(not self.running)))
        step = gui.add_button("Step")
        ticks = gui.add_number("steps per click", 1, min=1, max=10000, step=1)
        step.on_click(lambda _: self._order(lambda: self.step(int(ticks.value))))
        gui.add_button("Reset").on_click(lambda _: self._order(self.reset))
        self._speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
        control = gui.add_dropdown("controller", CONTROLS, initial_value=WEIGHT)
        self._on_change(control, self.choose)
        self._status = gui.add_markdown("")

    def _add_sliders(self, rig: InteractiveArm, actor: DrawnArm) -> list[Any]:
        model, sliders = rig.simulation.model, []
        with self._server.gui.add_folder(f"Joints of {actor.name}"):
            for i, name in enumerate(model.joint_names):
                label = f"{name} [m]" if model.joint_types[i] == "prismatic" else name
                values = slider_of(model, i, rig.simulation.state.q[i])
                sliders.append(self._server.gui.add_slider(label, *values))
                self._on_change(sliders[i], partial(self.slide, rig, i))
        return sliders

    def _add_push(self, rig: InteractiveArm, actor: DrawnArm, frames: Sequence[str]) -> None:
        gui = self._server.gui
        with gui.add_folder(f"Push {actor.name}", expand_by_default=False):
            frame = gui.add_dropdown("frame", frames, initial_value=actor.marker.hand)
            force = gui.add_vector3("force [N]", (0.0, 20.0, 0.0), step=1.0)
            lasting = gui.add_number("for [s]", 0.2, min=0.001, max=60.0, step=0.05)

            def push() -> None:
                ticks = max(1, round(lasting.value / rig.simulation.dt))
                rig.push(frame.value, np.array([*force.value, 0.0, 0.0, 0.0]), ticks)

            gui.add_button("Push").on_click(lambda _: self._order(push))

    async def _drag(self, rig: InteractiveArm, actor: DrawnArm, frame: str, event: Any) -> None:
        """Pull at a link; called in order of events, as plain functions would not be."""
        if event.phase == "end":
            self._order(rig.release)
        else:
            ends = np.array([event.start_position, event.end_position]) - actor.base
            self._order(partial(rig.pull, frame, *ends))

    def _start(self, marks: Any = ()) -> None:
        super()._start([*marks, ("➔", MOUSE, "pull of the mouse")])


def slider_of(model: ArmModel, joint: int, q: float) -> tuple[float, float, float, float]:
    """Least and largest value, step, and value of a joint's slider, of few enough digits to read.

    Its limits are those of the joint, rounded inwards; without them, it ends where the joint is.
    """
    wide = UNLIMITED.get(model.joint_types[joint], np.pi)
    low, high = model.position_lower[joint], model.position_upper[joint]
    low = low if np.isfinite(low) else min(-wide, high - 2 * wide)
    high = high if np.isfinite(high) else max(wide, low + 2 * wide)
    unit = 10.0 ** max(DECIMALS, np.ceil(np.log10(STEPS / (high - low))))
    first, last = np.ceil(min(low, q) * unit - 1e-3), np.floor(max(high, q) * unit + 1e-3)
    value = np.clip(np.round(q * unit), first, last)
    return float(first / unit), float(last / unit), 1.0 / unit, float(value / unit)
