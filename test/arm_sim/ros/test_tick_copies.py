# SPDX-License-Identifier: Apache-2.0
"""C copies ticks into the buffer for messages as Python does."""

from __future__ import annotations

import numpy as np
import pytest
from recorded_engine import engine_of, run, scene

from arm_sim.recording.files.messages import TickWriter
from arm_sim.ros.record import copying
from arm_sim.ros.record.chunks import HEAD, Chunk
from arm_sim.ros.record.copying import CopyInC, CopyInPython, State, tick_copy

TICK, STATE = 7, 300


@pytest.mark.parametrize("state", [None, (3_999_999_999, bytearray(range(213)))])
def test_both_copies_are_the_same_bytes(state: State | None) -> None:
    compiled = copying.native()
    assert compiled is not None
    engine = engine_of(scene())
    run(engine, 20)
    simulator = engine.simulator
    nx, n = simulator.plant.nx, simulator.n
    copies = (
        CopyInPython(TickWriter(nx, n), simulator, TICK, STATE),
        CopyInC(compiled.record, TickWriter(nx, n), simulator, TICK, STATE),
    )
    seen = list[tuple[bytes, list[int], int]]()
    for copy in copies:
        chunk = Chunk()
        for now, hold in (1_700_000_000_000_000_001, 0), (1_700_000_000_001_000_002, 2):
            copy(chunk, now, 2**40 + now % 10, hold, state)
        seen.append((chunk.data, chunk.starts.tolist(), chunk.since))
    assert seen[0] == seen[1]
    data, starts, since = seen[0]
    size = copies[0].size + (0 if state is None else HEAD + len(state[1]))
    assert len(data) == 2 * size and len(starts) == (2 if state is None else 4)
    assert since == 1_700_000_000_000_000_001
    assert np.frombuffer(data[-len(TickWriter(nx, n).raw) :], np.uint8)[-1] == 2, "what held it"


def test_without_a_compiler_python_copies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(copying, "native", lambda: None)
    simulator = engine_of(scene()).simulator
    writer = TickWriter(simulator.plant.nx, simulator.n)
    assert isinstance(tick_copy(writer, simulator, TICK, STATE), CopyInPython)
