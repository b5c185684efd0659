# SPDX-License-Identifier: Apache-2.0
"""Interactive simulations: run, pause, step, reset, place, push and pull."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_dynamics.actuation.command_map import CommandMap
from arm_dynamics.arrays import Array
from arm_dynamics.control.joint_space import GravityCompensation, PDGravity, tuned
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.trajectory.reference import Reference
from arm_sim.external_wrench import ExternalWrenches
from arm_sim.simulation.simulator import Simulator
from arm_sim.state import State
from arm_sim.view.charts import Chart, Charts, Samples, gathered
from arm_sim.view.draw_loop import DrawLoop
from arm_sim.view.live_account import LiveAccount
from arm_sim.view.marks import Instant, arrows, cones
from arm_sim.view.stage import DrawnArm

if TYPE_CHECKING:
    import viser

NOTHING, WEIGHT, SLIDERS = "nothing", "gravity compensation", "move to sliders"
CONTROLS = (WEIGHT, SLIDERS, NOTHING)
SPEEDS = ("0.05", "0.1", "0.25", "0.5", "1", "2")
AT_ONCE = 0.025  # [s] of real time that ticks may take between two frames
MEMORY = 10.0  # [s] that curves go back
SAMPLED = 0.02  # [s] between points of curves, in simulated time
CHARTED = 0.25  # [s] between drawings of curves
EAGER = 4.0  # [rad/s] with which references move to the sliders
UNLIMITED = {"prismatic": 1.0}  # half the range of a slider without limits in [m]; others: π
DECIMALS, STEPS = 3, 30  # of a slider, whose box is narrow: more decimals only for so many steps
PULL = 2.0 * 9.81  # [m/s²] by which the mouse accelerates what it holds from one reach away


class InteractiveArm:
    """A simulation with its controller, external forces and energy account.

    Args:
        simulation: The arm; the thread of the page's loop moves it.

    Attributes:
        damping: 1/T in [1/s] of gravity compensation, by which speeds decay.
    """

    def __init__(self, simulation: Simulator) -> None:
        self.simulation, self.account = simulation, LiveAccount(simulation)
        self._seen = simulation.state.step
        self.control, self.target = WEIGHT, simulation.state.q.copy()
        self.wrenches = ExternalWrenches(simulation.dynamics, "local_world_aligned")
        self._reference = self.target.copy(), np.zeros(simulation.n)
        self._pushable = self._pushed = False
        # Frame, point of it, place of the mouse.
        self._pull: tuple[str, Array, Array] | None = None
        model = simulation.model
        self._command = CommandMap(model)
        gains = tuned(simulation.dynamics, 20.0, 1.0, dt=simulation.dt)
        self._lead = PDGravity(simulation.dynamics, *gains)
        self._carry, self._rigid = GravityCompensation(simulation.dynamics), RigidTerms(model)
        # Critical: what the mouse holds, a mass on its spring, does not swing.
        self.damping = 2.0 * np.sqrt(PULL / model.reach)
        size = round(MEMORY / SAMPLED)
        self.samples, self.energies = Samples(maxlen=size), Samples(maxlen=size)

    def sample(self) -> None:
        """Keep torques, errors and energies for the curves, if the last ones are old enough."""
        now = self.simulation.state.time
        if not self.samples or now - self.samples[-1][0] >= SAMPLED - 1e-9:
            self.samples.append((now, np.concatenate([self.simulation.effort, self.error])))
            if (account := self.account.now()) is not None:
                self.energies.append((now, account))

    def look(self) -> Instant:
        """The picture of the current state, under the torque of the last tick."""
        simulation, state = self.simulation, self.simulation.state
        model = simulation.model
        forces = simulation.contact_forces() if model.scene.contacts else ()
        return Instant(
            state.time,
            state.q,
            arrows(forces),
            simulation.multipliers() if model.scene.bilateral else np.zeros(0),
            simulation.stop_torque,
            cones(forces, model.scene.contacts),
        )

    @property
    def error(self) -> Array:
        """Errors from the reference, shape (n,); zeros without a controller."""
        if self.control != SLIDERS:
            return np.zeros(self.simulation.n)
        return np.asarray(self._reference[0] - self.simulation.state.q)

    def choose(self, control: str) -> None:
        """Choose its controller."""
        state = self.simulation.state
        self.control, self.target = control, state.q.copy()
        self._reference = state.q.copy(), np.zeros(self.simulation.n)

    def push(self, frame: str, wrench: Array, ticks: int) -> None:
        """Apply a force in [N] and moment in [N m], in world axes, to a frame for some ticks."""
        if not self._pushable:
            self.wrenches.push(frame, wrench, 0)  # raises an error if it cannot be pushed
            self._make_pushable()
        self.wrenches.push(frame, wrench, self.simulation.state.step + ticks - 1)

    def pull(self, frame: str, held: Array, mouse: Array) -> None:
        """Pull a frame towards the mouse as by a spring, until released.

        Args:
            frame: The frame.
            held: Place where it is seized, which moves with it, in [m], shape (3,).
            mouse: Place of the mouse, likewise.
        """
        self._make_pushable()
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
        if state.step != self._seen:
            self.account.forget()  # the state was changed from elsewhere
        if self.wrenches.active or self._pull or self._pushed:
            simulation.set_parameter("external", self.external)
            self._pushed = bool(self.wrenches.active or self._pull)
        simulation.arm.advance(self._commanded(state).tolist())
        self._seen = state.step + 1
        self.account.note()

    def restart(self) -> None:
        """Reset, without external forces."""
        self.wrenches.clear()
        self.release()
        self.samples.clear()
        self.energies.clear()
        self.simulation.reset()
        self.account.forget()
        self.choose(self.control)

    def let_go(self) -> None:
        """End all external forces."""
        self.wrenches.clear()
        self.release()
        if self._pushed:
            self.simulation.set_parameter("external", np.zeros(self.simulation.n))
            self._pushed = False

    def place(self, q: Array) -> None:
        """Set its position, at rest."""
        self.simulation.set_state(q, np.zeros(self.simulation.n))
        self.account.forget()
        self.choose(self.control)

    def _make_pushable(self) -> None:
        if not self._pushable:
            arm = self.simulation.arm
            self.account.change(lambda: arm.use(arm.compiled.pushable()))
            self._pushable = True

    def _commanded(self, state: State) -> Array:
        if self.control == NOTHING:
            return np.zeros(self.simulation.n)
        if self.control == WEIGHT:
            # D = M(q)/T: every motion decays alike, its energy by exp(-2 t/T), in any posture.
            inertia = self._rigid.mass(state.q)
            torque = self._carry.torque(state) - self.damping * inertia @ state.v
        else:
            torque = self._lead.torque(state, self._led())
        return np.asarray(self._command(state.q, state.v, torque))

    def _led(self) -> Reference:
        """The reference after another tick: it follows the sliders without velocity jumps."""
        q, v = self._reference
        a = EAGER**2 * (self.target - q) - 2 * EAGER * v
        v = v + self.simulation.dt * a
        q = q + self.simulation.dt * v
        self._reference = q, v
        return Reference(q, v, a)


class Interactive:
    """The controls of a page that shows simulations.

    Args:
        server: The page.
        rigs: The simulations, one for each actor; they share a clock.
        actors: The arms.

    Attributes:
        loop: Its thread.
        running: Whether the simulation runs.
    """

    def __init__(
        self, server: viser.ViserServer, rigs: Sequence[InteractiveArm], actors: Sequence[DrawnArm]
    ) -> None:
        self._server, self.rigs = server, tuple(rigs)
        self._pairs = tuple(zip(rigs, actors, strict=True))
        self.running, self._owed, self._trouble = False, 0.0, ""
        self.loop = DrawLoop(self._beat, self._complain)
        self._add_buttons(server.gui)
        self._sliders = [self._add_sliders(*pair) for pair in self._pairs]
        for pair in self._pairs:
            self._add_push(*pair)
            self._add_pull(*pair)
        self._charts = Charts(server, self._curves())
        self._charted = 0.0
        for rig in self.rigs:
            rig.account.prepare()
        self.draw()

    # --- orders: for the thread of the loop ---------------------------------------------------

    def run(self, on: bool) -> None:
        """Run or pause."""
        self.running, self._owed, self._trouble = on, 0.0, ""
        self._run.label = "Pause" if on else "Run"
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
            actor.forget_way()
        self.draw()

    def draw(self) -> None:
        """Draw the current state of the arms."""
        with self._server.atomic():
            for rig, actor in self._pairs:
                actor.trail(actor.draw(rig.look()).hand)
        for rig, sliders in zip(self.rigs, self._sliders, strict=True):
            if rig.control != SLIDERS:
                model, q = rig.simulation.model, rig.simulation.state.q
                for i, slider in enumerate(sliders):
                    slider.min, slider.max, _, slider.value = _slider(model, i, q[i])
        self._show_status()
        if time.monotonic() - self._charted > CHARTED or not self.running:
            self._charted = time.monotonic()
            for chart in self._curves():
                self._charts.update(chart.title, chart.time, chart.values)

    # --- inside --------------------------------------------------------------------------------

    def _show_status(self) -> None:
        now = self.rigs[0].simulation.state.time
        going = f"running at {self._speed.value} ×" if self.running else "paused"
        if self.running and any(rig.account.in_preparation for rig in self.rigs):
            going += "; the energy account is being built"
        trouble = f"\n\n**{self._trouble}**" if self._trouble else ""
        self._status.content = f"t = {now:.3f} s, {going}{trouble}"

    def _beat(self, passed: float) -> None:
        if not self.running:
            return
        dt = max(rig.simulation.dt for rig in self.rigs)
        self._owed = min(self._owed + passed * float(self._speed.value), 0.25)
        until = time.monotonic() + AT_ONCE
        while self._owed >= dt and time.monotonic() < until:
            self._owed -= dt
            self._tick()
        self.draw()

    def _tick(self) -> None:
        """Advance all arms by the longest of their ticks."""
        dt = max(rig.simulation.dt for rig in self.rigs)
        for rig in self.rigs:
            for _ in range(round(dt / rig.simulation.dt)):
                rig.tick()
            rig.sample()

    def _choose(self, control: str) -> None:
        for rig in self.rigs:
            rig.choose(control)
        self.draw()

    def _complain(self, trouble: str) -> None:
        self.run(False)
        self._trouble = trouble
        self._show_status()

    def _curves(self) -> list[Chart]:
        """Torques, errors and energies of the last seconds."""
        charts = []
        for rig, actor in self._pairs:
            n, names, account = rig.simulation.n, rig.simulation.joint_names, rig.account.names
            title = f"{actor.name}: " if len(self.rigs) > 1 else ""
            time, values = gathered(rig.samples, 2 * n)
            charts += [
                Chart(f"{title}torque [N m]", names, time, values[:, :n]),
                Chart(f"{title}error [rad]", names, time, values[:, n:]),
                Chart(f"{title}energy [J]", account, *gathered(rig.energies, len(account))),
            ]
        return charts

    def _add_buttons(self, gui: viser.GuiApi) -> None:
        """Add what runs and controls all arms."""
        order = self.loop.order
        self._run = gui.add_button("Run")
        self._run.on_click(lambda _: order(lambda: self.run(not self.running)))
        step = gui.add_button("Step")
        self._ticks = gui.add_number("steps per click", 1, min=1, max=10000, step=1)
        step.on_click(lambda _: order(lambda: self.step(int(self._ticks.value))))
        gui.add_button("Reset").on_click(lambda _: order(self.reset))
        self._speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
        control = gui.add_dropdown("controller", CONTROLS, initial_value=WEIGHT)
        control.on_update(self.loop.moved(self._choose))
        self._status = gui.add_markdown("")

    def _add_sliders(self, rig: InteractiveArm, actor: DrawnArm) -> list[Any]:
        model, q, sliders = rig.simulation.model, rig.simulation.state.q, []
        with self._server.gui.add_folder(f"Joints of {actor.name}"):
            for i, (name, kind) in enumerate(
                zip(model.joint_names, model.joint_types, strict=True)
            ):
                label = f"{name} [m]" if kind == "prismatic" else name
                slider = self._server.gui.add_slider(label, *_slider(model, i, q[i]))
                slider.on_update(self.loop.moved(partial(self._slide, rig, i)))
                sliders.append(slider)
        return sliders

    def _slide(self, rig: InteractiveArm, joint: int, value: float) -> None:
        """Move the arm to the position of a slider, or set it there while paused."""
        if rig.control == SLIDERS:
            rig.target[joint] = value
        elif not self.running:
            q = rig.simulation.state.q.copy()
            q[joint] = value
            rig.place(q)
            self.draw()

    def _add_push(self, rig: InteractiveArm, actor: DrawnArm) -> None:
        gui, model = self._server.gui, rig.simulation.model
        frames = [name for name in model.frame_names if model.frame(name).parentJoint > 0]
        hand = actor.marker.hand
        with gui.add_folder(f"Push {actor.name}", expand_by_default=False):
            frame = gui.add_dropdown("frame", frames, initial_value=hand)
            force = [
                gui.add_number(f"force {axis} [N]", value, step=1.0)
                for axis, value in zip("xyz", (0.0, 20.0, 0.0), strict=True)
            ]
            lasting = gui.add_number("for [s]", 0.2, min=0.001, max=60.0, step=0.05)

            def push() -> None:
                ticks = max(1, round(lasting.value / rig.simulation.dt))
                rig.push(
                    frame.value, np.array([*(box.value for box in force), 0.0, 0.0, 0.0]), ticks
                )

            gui.add_button("Push").on_click(lambda _: self.loop.order(push))

    def _add_pull(self, rig: InteractiveArm, actor: DrawnArm) -> None:
        """Add a spring force at the point of a link that the mouse drags."""
        model = rig.simulation.model

        def dragged(frame: str) -> Callable[[Any], Any]:
            async def on_drag(event: Any) -> None:  # in order, as plain functions would not be
                if event.phase == "end":
                    self.loop.order(rig.release)
                    return
                ends = np.array([event.start_position, event.end_position]) - actor.base
                self.loop.order(lambda: rig.pull(frame, *ends))

            return on_drag

        for frame, link in actor.links:
            if frame in model.frame_names and model.frame(frame).parentJoint > 0:
                link.on_drag(dragged(frame))


def _slider(model: ArmModel, joint: int, q: float) -> tuple[float, float, float, float]:
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
