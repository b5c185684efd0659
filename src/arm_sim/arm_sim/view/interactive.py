# SPDX-License-Identifier: Apache-2.0
"""A page of simulations: run, pause, step, reset, place, push and pull."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from arm_dynamics.attributes import sealed
from arm_dynamics.model.arm import ArmModel
from arm_sim.view.charts import RollingCharts
from arm_sim.view.drawn_arm import MOUSE, DrawnArm
from arm_sim.view.interactive_arm import ENERGIES, InteractiveArm, Mode
from arm_sim.view.page import View

if TYPE_CHECKING:
    import viser

SPEEDS = ("0.05", "0.1", "0.25", "0.5", "1", "2")  # of simulated time, to choose from
BUDGET = 0.025  # [s] of real time that ticks may take between two frames
MEMORY = 10.0  # [s] that curves go back
SAMPLE_PERIOD = 0.02  # [s] between points of curves, in simulated time
CHART_PERIOD = 0.25  # [s] between drawings of curves
UNLIMITED = {"prismatic": 1.0}  # half the range of a slider without limits in [m]; others: π
DECIMALS, STEPS = 3, 30  # of a slider, whose box is narrow: more decimals only for so many steps


@sealed
class Interactive(View):
    """A page of simulations, which share a clock."""

    running: bool
    _own_marks = (("➔", MOUSE, "pull of the mouse"),)

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
        self._charts = RollingCharts(server, joints, ENERGIES, MEMORY, SAMPLE_PERIOD)
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
            if rig.mode != Mode.SLIDERS:
                model, q = rig.simulation.model, rig.simulation.state.q
                for i, slider in enumerate(sliders):
                    scale = slider_scale(model, i, q[i])
                    slider.min, slider.max, slider.value = scale.least, scale.largest, scale.value
        now = self.rigs[0].simulation.state.time
        going = f"running at {self._speed.value} ×" if self.running else "paused"
        trouble = f"\n\n**{self._message}**" if self._message else ""
        self._status.content = f"t = {now:.3f} s, {going}{trouble}"
        self._charts.draw(CHART_PERIOD if self.running else 0.0)

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

    def choose(self, mode: str) -> None:
        """Choose the controller of all arms."""
        for rig in self.rigs:
            rig.choose(mode)
        self.draw()

    def slide(self, rig: InteractiveArm, joint: int, value: float) -> None:
        """Move an arm to the position of a slider, or set it there while paused."""
        if rig.mode == Mode.SLIDERS:
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
        mode = gui.add_dropdown("controller", [mode.value for mode in Mode])
        self._on_change(mode, self.choose)
        self._status = gui.add_markdown("")

    def _add_sliders(self, rig: InteractiveArm, actor: DrawnArm) -> list[Any]:
        model, sliders = rig.simulation.model, []
        with self._server.gui.add_folder(f"Joints of {actor.name}"):
            for i, name in enumerate(model.joint_names):
                label = name if model.turning[i] else f"{name} [m]"
                scale = slider_scale(model, i, rig.simulation.state.q[i])
                sliders.append(self._server.gui.add_slider(label, *scale))
                self._on_change(sliders[i], partial(self.slide, rig, i))
        return sliders

    def _add_push(self, rig: InteractiveArm, actor: DrawnArm, frames: Sequence[str]) -> None:
        """Add the controls of a push: frame, force and duration."""
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
            self._order(rig.mouse.release)
        else:
            ends = np.array([event.start_position, event.end_position]) - actor.base
            self._order(partial(rig.pull, frame, *ends))


class SliderScale(NamedTuple):
    """Numbers of a slider, of few enough digits to read."""

    least: float
    largest: float
    step: float
    value: float


def slider_scale(model: ArmModel, joint: int, q: float) -> SliderScale:
    """The scale of a joint at a position in [rad] or [m].

    Its limits are those of the joint, rounded inwards; without them, it ends where the joint is.
    """
    wide = UNLIMITED.get(model.joint_types[joint], np.pi)
    low, high = model.position_lower[joint], model.position_upper[joint]
    low = low if np.isfinite(low) else min(-wide, high - 2 * wide)
    high = high if np.isfinite(high) else max(wide, low + 2 * wide)
    unit = 10.0 ** max(DECIMALS, np.ceil(np.log10(STEPS / (high - low))))
    first, last = np.ceil(min(low, q) * unit - 1e-3), np.floor(max(high, q) * unit + 1e-3)
    value = np.clip(np.round(q * unit), first, last)
    return SliderScale(float(first / unit), float(last / unit), 1.0 / unit, float(value / unit))
