# SPDX-License-Identifier: Apache-2.0
"""Ticks and joint states in the buffer for messages are records of the file's format."""

from __future__ import annotations

from ctypes import addressof

import pytest
from recorded_engine import engine_of, run, scene

from arm_dynamics.cdr import GIGA
from arm_dynamics.codegen.addresses import address
from arm_sim.recording.files.messages import tick_layout
from arm_sim.ros.node_library import library
from arm_sim.ros.record.chunk import PERIOD_NS, Chunk
from arm_sim.ros.record.chunk_thread import SIZE
from arm_sim.ros.record.ticks import TickCopy

TICK, STATE = 7, 300
TIMES = (1_700_000_000_000_000_001, 1_700_000_000_001_000_002)


@pytest.mark.parametrize("state", [None, (3_999_999_999, bytearray(range(213)))])
def test_a_tick_follows_the_joint_state_published_for_it(
    state: tuple[int, bytearray] | None,
) -> None:
    engine = engine_of(scene())
    run(engine, 20)
    simulator, chunk = engine.simulator, Chunk(SIZE)
    copy = TickCopy(simulator.arm, TICK, STATE)
    layout = tick_layout(simulator.arm.plant.nx, simulator.n)
    wanted = list[tuple[int, int, bytes, int]]()
    for now, hold in zip(TIMES, (0, 2), strict=True):
        stamp = 2**40 + now % 10
        told = (0, bytearray(1)) if state is None else state
        size = 0 if state is None else len(told[1])
        library().record(
            chunk.address, addressof(copy), now, stamp, hold, address(told[1]), size, told[0]
        )
        if state is not None:
            wanted.append((STATE, now, bytes(state[1]), state[0]))
        wanted.append((TICK, now, bytes(copy.message), stamp))
        (tick,) = layout.read([bytes(copy.message)])
        assert tick["hold"] == hold and tuple(tick["stamp"]) == divmod(stamp, GIGA)
        assert tick["state"].tolist() == simulator.arm.x.tolist()
        assert tick["command"].tolist() == simulator.arm.acted.tolist()
    assert list(chunk.messages()) == wanted
    assert chunk.since == TIMES[0]


def test_a_chunk_takes_what_just_fits_until_it_is_too_old() -> None:
    chunk, now = Chunk(SIZE), TIMES[0]
    assert chunk.fits(now, SIZE) and not chunk.fits(now, SIZE + 1)
    chunk.put(TICK, now, 0, b"message")
    assert chunk.fits(now, SIZE - chunk.at) and not chunk.fits(now, SIZE - chunk.at + 1)
    assert chunk.fits(now + PERIOD_NS, 0) and not chunk.fits(now + PERIOD_NS + 1, 0)
    chunk.clear()
    assert chunk.fits(now + PERIOD_NS + 1, 0), "an empty one has no age"
