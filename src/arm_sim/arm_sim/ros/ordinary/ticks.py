# SPDX-License-Identifier: Apache-2.0
"""Executes ordinary ticks in C."""

from __future__ import annotations

from ctypes import Structure, addressof, byref, c_double, c_int64, c_void_p
from pathlib import Path
from threading import Lock

import numpy as np

from arm_dynamics.ros.joint_state import CompiledReader, native
from arm_sim.imperfections import command_line
from arm_sim.ros.inputs import AT_ONCE, Inputs
from arm_sim.ros.lockstep import Ahead, Waiting
from arm_sim.ros.outputs import Outputs
from arm_sim.ros.realtime_loop import Due
from arm_sim.ros.record import RECORD, TickRecorder
from arm_sim.ros.record.chunks import PERIOD_NS, SIZE
from arm_sim.ros.stamps import NodeTime
from arm_sim.ros.tick_engine import TickEngine

SOURCE = Path(__file__).with_name("native") / "ticks.c"
_KINDS = 4  # as in joint_state.c
_FUNCTIONS = ("by_the_clock", "in_lockstep")
_LEFT, _MADE = range(2)  # as in ticks.c
_ROWS = 8192  # ticks stored for the energy account, which is evaluated every second


class Ticks(Structure):
    """``ticks_t`` of ticks.c, where the fields are explained."""

    _fields_ = (
        ("bell", c_void_p),
        ("source", c_void_p), ("reader", c_void_p), ("at_once", c_int64),
        ("leads", c_int64 * _KINDS),
        ("share", c_double),
        ("now", c_double), ("patience", c_int64), ("heard", c_double), ("count", c_int64),
        ("age", c_double), ("timeout", c_int64), ("newest", c_void_p), ("fresh", c_int64),
        ("pending", c_int64),
        ("step", c_void_p), ("joints", c_int64), ("states", c_int64), ("ticks", c_int64),
        ("notice", c_int64), ("drives", c_void_p),
        ("trail", c_void_p), ("acted", c_void_p), ("room", c_int64), ("kept", c_int64),
        ("noted", c_int64),
        ("every", c_int64), ("seldom", c_int64), ("state", c_void_p), ("clock", c_void_p),
        ("times", c_void_p), ("trip", c_void_p),
        ("chunk", c_void_p), ("copy", c_void_p), ("size", c_int64), ("oldest", c_int64),
        ("commands", c_int64), ("recorded", c_int64),
    )  # fmt: skip


class OrdinaryTicks:
    """Executes ticks in C as long as they are ordinary, for the ticking thread.

    Attributes:
        refusal: Reason why C can never execute ticks of this node; empty if it can.
        count: Number of ticks executed in C.
    """

    def __init__(
        self,
        engine: TickEngine,
        inputs: Inputs,
        outputs: Outputs,
        recorder: TickRecorder | None,
        commands: str,
    ) -> None:
        """Check whether C can execute the scene's ticks; ``commands`` is their resolved topic."""
        self._engine, self._inputs, self._outputs = engine, inputs, outputs
        self._recorder, self._listeners, self.count = recorder, len(engine.on_tick), 0
        self.refusal = self._why_not()
        library = None if self.refusal else native(RECORD, SOURCE)
        if library is None:
            self.refusal = self.refusal or "no compiler, or no headers of ROS"
            return
        self._functions = {name: getattr(library, name) for name in _FUNCTIONS}
        for function in self._functions.values():
            function.restype = c_int64
        simulator, stamps = engine.simulator, outputs.stamps
        n, nx = simulator.n, simulator.plant.nx
        self._newest = np.zeros(n)
        self._trail, self._acted = np.zeros((_ROWS, nx)), np.zeros((_ROWS, n))
        self._noting, engine.note_ticks = Lock(), self._note
        self._ticks = Ticks(
            bell=addressof(engine.queue.bell), at_once=AT_ONCE,
            newest=self._newest.ctypes.data, joints=n, states=nx,
            trail=self._trail.ctypes.data, acted=self._acted.ctypes.data,
            drives=None if outputs.drives is None else outputs.drives.place,
            every=outputs.every, state=outputs.states.place,
            clock=None if outputs.clock is None else addressof(outputs.clock.sink),
            times=addressof(stamps) if isinstance(stamps, NodeTime) else None,
            trip=addressof(inputs.round_trip), size=SIZE, oldest=PERIOD_NS,
        )  # fmt: skip
        if recorder is not None:
            self._ticks.copy, self._ticks.commands = recorder.place, recorder.channel(commands)

    def _why_not(self) -> str:
        simulator, reader = self._engine.simulator, self._inputs.reader
        if not isinstance(reader, CompiledReader):
            return "no compiler, or no headers of ROS"
        self._reader = reader
        if simulator.pointers is None:
            return "the scene runs on CasADi's virtual machine"
        if simulator.sensors is not None or command_line(simulator.model.scene, simulator.dt):
            return "the scene has sensors or delayed commands"
        if not self._outputs.plain:
            return "joint states of all joints are computed in Python"
        return ""

    def by_the_clock(self, due: Due) -> bool:
        """Execute the ticks that are due until one is not ordinary.

        Returns:
            Whether no tick is left to ``TickEngine.tick`` yet.
        """
        return self._made_by("by_the_clock", due) != _LEFT

    def in_lockstep(self, waiting: Waiting) -> Ahead:
        """Execute ticks triggered by answers, as long as these arrive soon and are ordinary."""
        return Ahead(self._made_by("in_lockstep", waiting))

    def _made_by(self, function: str, what: Structure) -> int:
        """Execute ticks; return the reason for the end."""
        if self.refusal or not self._begin():
            return _LEFT
        recorder, chunk = self._recorder, None
        if recorder is not None:
            if (chunk := recorder.lend()) is None:
                return _LEFT
            self._ticks.chunk = chunk.address
        try:
            why = int(self._functions[function](byref(self._ticks), byref(what)))
        finally:
            if recorder is not None:
                recorder.take_back(self._ticks.recorded)
        self._end()
        if why == _MADE:
            self._engine.tell_unattended()
        return why

    def _begin(self) -> bool:
        """Pass the current settings to C; return whether the next tick may be ordinary."""
        engine, ticks = self._engine, self._ticks
        slot, arbiter, simulator = engine.commands, engine.arbiter, engine.simulator
        efforts, only, reader = slot.efforts, arbiter.only, self._reader
        if efforts is None or only is None or reader.left or not engine.ordinary:
            return False
        name, heard = only
        if len(heard.joints) < simulator.n or len(engine.on_tick) != self._listeners:
            return False
        self._before, self._heard = efforts, heard
        self._ahead = simulator.step_count - ticks.kept
        self._newest[:] = efforts
        ticks.source, ticks.reader = reader.places
        leads = reader.whole_from(name)
        ticks.leads[: len(leads)] = leads
        ticks.now, ticks.patience = arbiter.now, arbiter.patience
        ticks.heard, ticks.count = heard.at, heard.count
        ticks.age, ticks.timeout = slot.age, slot.timeout
        ticks.step, ticks.ticks = addressof(simulator.pointers), simulator.step_count
        ticks.notice, ticks.room = simulator.notices_cuts, _ROWS if engine.accounted else 0
        ticks.seldom = self._outputs.seldom
        ticks.fresh = ticks.pending = ticks.recorded = 0
        return True

    def _end(self) -> None:
        """Update the parts of the node with the executed ticks."""
        engine, ticks = self._engine, self._ticks
        arbiter = engine.arbiter
        arbiter.now, self._heard.at, self._heard.count = ticks.now, ticks.heard, ticks.count
        efforts = self._before
        if ticks.fresh:
            efforts = tuple(self._newest.tolist())
            self._inputs.follow(efforts)
        engine.commands.acted(self._before, efforts, ticks.age)
        self._reader.left = ticks.pending
        self._note()
        if made := ticks.ticks - engine.simulator.step_count:
            self.count += made
            engine.simulator.passed(made)

    def _note(self) -> None:
        """Note the ticks executed so far in the energy account; for any thread."""
        ticks = self._ticks
        with self._noting:
            noted, kept = ticks.noted, ticks.kept
            if kept > noted:
                rows = np.arange(noted, kept) % _ROWS
                self._engine.note(self._trail[rows], self._acted[rows], self._ahead + kept)
                ticks.noted = kept
