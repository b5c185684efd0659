# SPDX-License-Identifier: Apache-2.0
"""Plays recordings: at any time and speed, repeatedly, with their forces and plots."""

from __future__ import annotations

import io
from base64 import b64encode
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed
from arm_sim.figures import units
from arm_sim.recording import Recording
from arm_sim.recording.figure import LONG, QUANTITIES
from arm_sim.stepping.contact_forces import contact_forces
from arm_sim.view.charts import ChartPanel
from arm_sim.view.drawn_arm import DrawnArm
from arm_sim.view.marks import Instant, contacts_of
from arm_sim.view.page import View

if TYPE_CHECKING:
    import viser

SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "5", "10")  # of the recording, to choose from
WAY_POINTS = 1500  # points of the path of the end effector
POINTS = 4000  # points of curves of energies
FIGURES = (
    "<style>body {display: flex} #root {flex: 3; min-width: 0} #figures {order: -1; flex: 2; "
    "height: 100%; overflow-y: auto; background: #fff} #figures img {width: 100%} "
    "@media (max-width: 700px) {body {flex-direction: column} #figures {order: 1}}</style>"
)


@sealed
class Player(View):
    """A page of recordings, which begin together, at a ``time`` in [s]."""

    time: float

    def __init__(
        self, server: viser.ViserServer, actors: Sequence[DrawnArm],
        recordings: Sequence[Recording],
    ) -> None:  # fmt: skip
        super().__init__(server, actors)
        self._motions = tuple(zip(recordings, actors, strict=True))
        begin = min(float(recording.time[0]) for recording in recordings)
        end = max(float(recording.time[-1]) for recording in recordings)
        self._begin, self._end, self.time, self._playing = begin, end, begin, False
        gui, step = server.gui, max(round((end - begin) / 20000, 3), 1e-3)
        first, last = float(np.floor(begin * 1e3) / 1e3), float(np.ceil(end * 1e3) / 1e3)
        self._slider = gui.add_slider("time [s]", first, max(last, first + step), step, first)
        self._on_change(self._slider, self.seek)
        self._button = gui.add_button("Play")
        self._button.on_click(lambda _: self._order(lambda: self.play(not self._playing)))
        self._speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
        self._loop = gui.add_checkbox("loop", True)
        self._status = gui.add_markdown("")
        self._panel = ChartPanel(server)
        for recording, actor in self._motions:
            of = f"{actor.name}: " if len(actors) > 1 else ""
            for title, names, time, values in _curves(recording):
                self._panel.add(of + title, names).draw(time, values)
            rows = np.unique(np.linspace(0, len(recording) - 1, WAY_POINTS).astype(int))
            actor.show_path(recording.q[rows])
        self.seek(begin)

    def play(self, on: bool = True) -> None:
        """Start or stop playing; for the thread of the page."""
        if on and self.time >= self._end:
            self.seek(self._begin)
        self._playing = on
        self._button.label = "Pause" if on else "Play"

    def seek(self, time: float) -> None:
        """Show a time in [s]; for the thread of the page."""
        self.time = min(max(time, self._begin), self._end)
        with self._server.atomic():
            for recording, actor in self._motions:
                actor.draw(instant(recording, self.time))
        self._slider.value = self.time
        self._panel.show_values(self.time)
        self._report("")

    def _seek(self, time: float) -> None:
        self.play(False)
        self.seek(time)

    def _update(self, passed: float) -> None:
        if not self._playing:
            return
        time = self.time + passed * float(self._speed.value)
        if time < self._end:
            self.seek(time)
        elif self._loop.value and self._end > self._begin:
            self.seek(self._begin)
        else:
            self._seek(self._end)

    def _report(self, trouble: str) -> None:
        text = f"t = {self.time:.3f} s of {self._end:.3f} s"
        self._status.content = f"{text}\n\n**{trouble}**" if trouble else text

    def _with_figures(self, page: str) -> str:
        images = []
        for recording, _ in self._motions:
            file = io.BytesIO()
            recording.plot().savefig(file)
            data = b64encode(file.getvalue()).decode()
            images.append(f'<img src="data:image/png;base64,{data}">')
        head, end, tail = page.rpartition("</body>")
        return f'{head}{FIGURES}<div id="figures">{"".join(images)}</div>{end}{tail}'


def instant(recording: Recording, time: float) -> Instant:
    """The last state up to a time, with forces; those of a robot are unknown."""
    row = max(0, bisect_right(recording.time, time + 1e-9) - 1)
    if recording.of_robot:
        return Instant(recording.q[row])
    part, model = recording.part([row]), recording.plant.model
    tied, stopped = model.scene.bilateral, model.stops.touched(part.q).any()
    contacts = np.zeros((0, 3, 3))
    if part.physics is not None and part.plant.points:
        stepper = part.physics.replay_stepper
        stepper.p[:] = part.p[0]
        forces = contact_forces(part.plant, stepper, part.x[0], part.command[0])
        contacts = contacts_of(model, forces)
    return Instant(
        part.q[0], contacts, part.multipliers[0] if tied else np.zeros(0),
        part.stop_torque[0] if stopped else np.zeros(model.n),
    )  # fmt: skip


def _curves(recording: Recording) -> Iterator[tuple[str, Sequence[str], Array, Array]]:
    """Titles of charts, with names, times and values of their curves."""
    model = recording.dynamics.model
    for quantity, (attribute, *unit) in QUANTITIES.items():
        if np.isfinite(values := getattr(recording, attribute)).any():
            name = "torque" if quantity == "effort" else quantity
            title = f"{name} [{units(model.joint_types, *unit)}]"
            yield (title, model.joint_names, recording.time, values)
    if recording.of_robot:
        return  # work and heat between its states are unknown
    if (error := recording.local_error).any():
        yield ("error [rad]", ("estimated error of q",), recording.time, error[:, None])
    rows = np.unique(np.linspace(0, len(recording) - 1, POINTS).astype(int))
    part = recording.part(rows)
    curves = {"kinetic": part.kinetic, "potential": part.potential, "total": part.energy}
    if len(recording) <= LONG or not recording.account.repeats(recording.x):
        supplied, lost = recording.supplied[rows], recording.lost[rows]
        curves |= {"supplied": supplied, "lost": lost, "balance": recording.balance[rows]}
    yield ("energy [J]", tuple(curves), part.time, np.column_stack(list(curves.values())))
