# SPDX-License-Identifier: Apache-2.0
"""Executes ordinary ticks in C."""

from __future__ import annotations

from ctypes import Structure, addressof, byref
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_sim.ros.inputs import AT_ONCE, Inputs
from arm_sim.ros.lockstep import Ahead, Waiting
from arm_sim.ros.node_library import TICKS, library
from arm_sim.ros.outputs import Outputs
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.ros.timing.realtime_loop import Due
from arm_sim.ros.timing.stamps import NodeTime

if TYPE_CHECKING:
    from arm_sim.ros.record import TickRecorder

_LEFT, _MADE = TICKS.constants["LEFT"], TICKS.constants["MADE"]
_ROWS = 8192  # ticks stored for the energy account, which is evaluated every second


class Ticks(Structure):
    """``ticks_t`` of ticks.h, where the fields are explained."""

    _fields_ = TICKS.fields("ticks_t")


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
        self._native, self._reader = library(), inputs.reader
        self.refusal = self._why_not()
        if self.refusal:
            return
        arm, stamps = engine.simulator.arm, outputs.stamps
        n, nx = arm.n, arm.plant.nx
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
            trip=addressof(inputs.round_trip),
        )  # fmt: skip
        if recorder is not None:
            self._ticks.copy, self._ticks.commands = recorder.place, recorder.channel(commands)

    def _why_not(self) -> str:
        arm = self._engine.simulator.arm
        if arm.pointers is None:
            return "the scene runs on CasADi's virtual machine"
        if arm.sensors is not None or arm.line is not None:
            return "the scene has sensors or delayed commands"
        if not self._outputs.plain:
            return "joint states of all joints are computed in Python"
        return ""

    def by_the_clock(self, due: Due) -> bool:
        """Begin the ticks that are due, and execute them until one is not ordinary.

        Returns:
            Whether no tick that has begun is left to ``TickEngine.tick``.
        """
        why = self._made_by(self._native.by_the_clock, due)
        if why is None:
            self._native.await_tick(byref(due))
        return why not in (None, _LEFT)

    def in_lockstep(self, waiting: Waiting) -> Ahead:
        """Execute ticks triggered by answers, as long as these arrive soon and are ordinary."""
        why = self._made_by(self._native.in_lockstep, waiting)
        return Ahead.CANNOT if why is None else Ahead(why)

    def _made_by(self, function: Any, what: Structure) -> int | None:
        """Execute ticks; return the reason for the end, or None if none may be ordinary."""
        if self.refusal or not self._begin():
            return None
        recorder, chunk = self._recorder, None
        if recorder is not None:
            if (chunk := recorder.lend()) is None:
                return None
            self._ticks.chunk = chunk.address
        try:
            why = int(function(byref(self._ticks), byref(what)))
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
        slot, arbiter, arm = engine.commands, engine.arbiter, engine.simulator.arm
        efforts, only, reader = slot.efforts, arbiter.only, self._reader
        if efforts is None or only is None or reader.left or not engine.ordinary:
            return False
        if self._inputs.rivals.alarm.words:  # is a command for this sim?
            return False
        name, heard = only
        if len(heard.joints) < arm.n or len(engine.on_tick) != self._listeners:
            return False
        self._before, self._heard = efforts, heard  # kept alive for C
        self._ahead = arm.step_count - ticks.kept
        self._newest[:] = efforts
        ticks.source, ticks.reader = reader.places
        leads = reader.whole_from(name)
        ticks.leads[: len(leads)] = leads
        ticks.now, ticks.patience = arbiter.now, arbiter.patience
        ticks.stream = addressof(heard)
        ticks.age, ticks.timeout = slot.age, slot.timeout
        ticks.step, ticks.ticks = addressof(arm.pointers), arm.step_count
        ticks.notice, ticks.room = arm.notices_cuts, _ROWS if engine.accounted else 0
        ticks.seldom = self._outputs.seldom
        ticks.fresh = ticks.pending = ticks.recorded = 0
        return True

    def _end(self) -> None:
        """Update the parts of the node with the executed ticks."""
        engine, ticks = self._engine, self._ticks
        engine.arbiter.now = ticks.now
        efforts = self._before
        if ticks.fresh:
            efforts = tuple(self._newest.tolist())
            self._inputs.follow(efforts)
        engine.commands.acted(self._before, efforts, ticks.age)
        self._reader.left = ticks.pending
        self._note()
        arm = engine.simulator.arm
        if made := ticks.ticks - arm.step_count:
            self.count += made
            arm.passed(made)

    def _note(self) -> None:
        """Note the ticks executed so far in the energy account; for any thread."""
        ticks = self._ticks
        with self._noting:
            noted, kept = ticks.noted, ticks.kept
            if kept > noted:
                rows = np.arange(noted, kept) % _ROWS
                self._engine.note(self._trail[rows], self._acted[rows], self._ahead + kept)
                ticks.noted = kept
