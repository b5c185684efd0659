# SPDX-License-Identifier: Apache-2.0
"""Ticks in C beside the threads of a node, which are in C as well.

Under ``tools/sanitize.py thread`` every access of each thread is watched; Python's own are not.
"""

from ctypes import Structure, byref, c_int64
from pathlib import Path

import pytest

from arm_dynamics.codegen.header import Header
from arm_sim.ros import node_library

THREADS = Path(__file__).parents[2] / "support/tick_threads.c"
ORDERS = 100


class Done(Structure):
    """``done_t`` of tick_threads.c."""

    _fields_ = Header(THREADS, only="done_t").fields("done_t")


@pytest.mark.parametrize("period", [0, 20_000], ids=["as fast as it can", "by the clock"])
def test_orders_diagnostics_and_the_recording_go_on_beside_ticks(period: int) -> None:
    library = node_library.library(THREADS)
    done = Done()
    library.run_threads.restype = None
    library.run_threads(c_int64(ORDERS), c_int64(period), byref(done))
    assert done.orders == ORDERS
    assert 0 < done.ticks == done.counted
    assert done.recorded == done.written == done.noted == done.ticks
    assert done.looks > 0
