# SPDX-License-Identifier: Apache-2.0
"""Ticks and joint states in the buffer for messages are records of the file's format."""

from __future__ import annotations

import numpy as np
import pytest
from recorded_engine import engine_of, run, scene

from arm_dynamics.cdr import GIGA, TIME
from arm_dynamics.ros.joint_state import address
from arm_sim.recording.files import MESSAGE
from arm_sim.recording.files.messages import TickWriter
from arm_sim.ros.node_library import library
from arm_sim.ros.record.chunks import HEAD, PERIOD_NS, SIZE, Chunk
from arm_sim.ros.record.copying import TickCopy

TICK, STATE = 7, 300
TIMES = (1_700_000_000_000_000_001, 1_700_000_000_001_000_002)
OPCODE = 5


@pytest.mark.parametrize("state", [None, (3_999_999_999, bytearray(range(213)))])
def test_a_tick_follows_the_joint_state_published_for_it(
    state: tuple[int, bytearray] | None,
) -> None:
    engine = engine_of(scene())
    run(engine, 20)
    simulator, chunk = engine.simulator, Chunk(SIZE)
    writer = TickWriter(simulator.arm.plant.nx, simulator.n)
    copy = TickCopy(writer, simulator.arm, TICK, STATE)
    wanted = list[tuple[int, int, int, bytes]]()
    for now, hold in zip(TIMES, (0, 2), strict=True):
        stamp = 2**40 + now % 10
        told = (0, bytearray(1)) if state is None else state
        size = 0 if state is None else len(told[1])
        library().record(
            chunk.address, copy.place, now, stamp, hold, address(told[1]), size, told[0]
        )
        if state is not None:
            wanted.append((STATE, now, state[0], bytes(state[1])))
        wanted.append((TICK, now, stamp, bytes(writer.raw)))
        assert writer.raw[writer.hold] == hold
        assert TIME.unpack_from(writer.raw, writer.stamp) == divmod(stamp, GIGA)
    assert np.frombuffer(writer.state).tolist() == simulator.arm.x.tolist()
    assert np.frombuffer(writer.command).tolist() == simulator.arm.acted.tolist()
    found, at = list[tuple[int, int, int, bytes]](), 0
    for start in chunk.starts.tolist():
        opcode, length, channel, _, log, publish = MESSAGE.unpack_from(chunk.data, start)
        data = chunk.data[start + HEAD : start + 9 + length]
        assert (opcode, start) == (OPCODE, at)
        at = start + 9 + length
        found.append((channel, log, publish, data))
    assert found == wanted and at == chunk.at
    assert chunk.since == TIMES[0]


def test_a_chunk_takes_what_just_fits_until_it_is_too_old() -> None:
    chunk, now = Chunk(SIZE), TIMES[0]
    assert chunk.fits(now, SIZE) and not chunk.fits(now, SIZE + 1)
    chunk.put(TICK, now, 0, b"message")
    assert chunk.fits(now, SIZE - chunk.at) and not chunk.fits(now, SIZE - chunk.at + 1)
    assert chunk.fits(now + PERIOD_NS, 0) and not chunk.fits(now + PERIOD_NS + 1, 0)
    chunk.clear()
    assert chunk.fits(now + PERIOD_NS + 1, 0), "an empty one has no age"
