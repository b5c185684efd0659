# SPDX-License-Identifier: Apache-2.0
"""The least that can be done, to compare with: a thread, a timer, a ping and its echo, a server.

Each is a process: ``python -m benchmarks.loop.baseline NAME SECONDS [PERIOD]``; it prints what it
measured. The period in [ns] is the thread's.
"""

import ctypes
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

PERIOD = 1_000_000  # [ns]
_PR_SET_TIMERSLACK = 29


def thread(seconds: float, period: int = PERIOD) -> dict[str, Any]:
    """Sleep to absolute deadlines in C, a period in [ns] apart, and do nothing."""
    from arm_dynamics.codegen import compiler

    library = compiler.build(Path(__file__).with_name("bare.c").read_text()).library
    late = np.zeros(round(1e9 * seconds / period), np.int64)
    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)  # as the sim asks for
    used = time.process_time()
    library.sleep_to_deadlines(
        ctypes.c_int64(period), ctypes.c_int64(late.size), ctypes.c_void_p(late.ctypes.data)
    )
    used = time.process_time() - used
    share = {"share": used / seconds, "rate": late.size / seconds}
    return share | lateness(late, period)


def lateness(late: np.ndarray, period: int = PERIOD) -> dict[str, Any]:
    """How well deadlines were kept, from how late each tick was in [ns]."""
    # Summed up here: to write every single one down would keep a processor busy for a second,
    # beside the node that is being measured.
    micro, counts = np.unique(late // 1000, return_counts=True)
    return {
        "missed": int((late > period).sum()), "ticks": len(late), **spread(late),
        "bars": np.transpose([1e-6 * (micro + 1), counts]).tolist(),
    }  # fmt: skip


def spread(durations: np.ndarray) -> dict[str, float]:
    """Percentiles in [s] of durations in [ns]."""
    p50, p99 = np.percentile(durations, [50, 99])
    return {"p50": 1e-9 * p50, "p99": 1e-9 * p99, "max": 1e-9 * float(durations.max())}


def timer(seconds: float) -> dict[str, Any]:
    node, executor = _spun("bare_timer")
    came: list[int] = []
    node.create_timer(1e-9 * PERIOD, lambda: came.append(time.monotonic_ns()))
    _spin(executor, lambda: False, seconds)
    gaps = np.diff(came)
    return {
        "rate": len(came) / seconds, "missed": int((gaps > 2 * PERIOD).sum()),
        "ticks": len(came), "share": time.process_time() / seconds,
    }  # fmt: skip


def echo(seconds: float) -> dict[str, Any]:
    """Send every joint state back, as rclpy does it by default."""
    node, executor = _spun("bare_echo")
    from sensor_msgs.msg import JointState

    publisher = node.create_publisher(JointState, "bare_echo", 10)
    node.create_subscription(JointState, "bare_ping", publisher.publish, 10)
    _spin(executor, lambda: False, seconds)
    return {}


def ping(seconds: float) -> dict[str, Any]:
    """Send a joint state, wait for it to come back, send the next one a millisecond after it.

    As in the loop: who sends in a row finds everything in the caches, and is quicker by half.
    """
    node, executor = _spun("bare_ping")
    from sensor_msgs.msg import JointState

    publisher = node.create_publisher(JointState, "bare_ping", 10)
    back: list[int] = []
    subscription = node.create_subscription(
        JointState, "bare_echo", lambda _: back.append(time.monotonic_ns()), 10
    )
    message = JointState(name=[f"joint{i}" for i in range(7)])
    message.position = message.velocity = message.effort = [0.0] * 7
    trips = []
    there = lambda: publisher.get_subscription_count() and node.count_publishers("bare_echo")  # noqa: E731
    _spin(executor, there, 20.0)
    del subscription
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        back.clear()
        sent = time.monotonic_ns()
        publisher.publish(message)
        if _spin(executor, lambda: back, 1.0):
            trips.append(back[0] - sent)
        time.sleep(max(0.0, 1e-9 * (sent + PERIOD - time.monotonic_ns())))
    return {"trips": trips}


def server(seconds: float) -> dict[str, Any]:
    """Answer inverse dynamics with nothing, as rclpy does it by default."""
    node, executor = _spun("bare_server")
    from arm_dynamics.ros.interfaces import INVERSE_DYNAMICS

    node.create_service(INVERSE_DYNAMICS.type, INVERSE_DYNAMICS.name, lambda _, response: response)
    _spin(executor, lambda: False, seconds)
    return {}


class Client:
    """Calls the service of ``server``, as rclpy does it by default."""

    def __init__(self, domain: int) -> None:
        import rclpy
        from rclpy.context import Context

        from arm_dynamics.ros.interfaces import INVERSE_DYNAMICS

        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self._node = rclpy.create_node("bare_client", context=self._context)
        name = INVERSE_DYNAMICS.name.replace("~", "/bare_server")
        self._client = self._node.create_client(INVERSE_DYNAMICS.type, name)
        self._executor = rclpy.executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        if not self._client.wait_for_service(timeout_sec=60.0):
            raise TimeoutError(f"nobody offers {name}")

    def ask(self, request: Any) -> None:
        future = self._client.call_async(request)
        while not future.done():
            self._executor.spin_once(timeout_sec=1.0)

    def close(self) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()


def _spun(name: str) -> tuple[Any, Any]:
    import rclpy

    rclpy.init()
    node = rclpy.create_node(name)
    executor = rclpy.executors.SingleThreadedExecutor()
    executor.add_node(node)
    return node, executor


def _spin(executor: Any, done: Callable[[], Any], timeout: float) -> bool:
    end = time.monotonic() + timeout
    while not done():
        if time.monotonic() > end:
            return False
        executor.spin_once(timeout_sec=0.1)
    return True


if __name__ == "__main__":
    measure: Callable[..., dict[str, Any]] = {
        "thread": thread, "timer": timer, "ping": ping, "echo": echo, "server": server,
    }[sys.argv[1]]  # fmt: skip
    print(json.dumps(measure(float(sys.argv[2]), *map(int, sys.argv[3:]))), flush=True)
