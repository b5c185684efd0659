# SPDX-License-Identifier: Apache-2.0
"""Requests and commands in any sequence: a sim by the clock equals one by hand.

``--fuzz N`` makes the test N times as long; ``tools/sanitize.py`` runs it under sanitizers.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import CDLL, Structure, addressof, byref, c_int64, c_void_p
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arm_msgs.msg import Energy
from bent_messages import bent
from harness import Ros
from pushes import pushed
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from recorded_engine import contents
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, by_hand, next_command
from std_msgs.msg import Float64MultiArray

import models
from arm_dynamics.codegen.addresses import address
from arm_dynamics.codegen.header import Header
from arm_dynamics.ros import interfaces
from arm_dynamics.ros.common.convert import to_time
from arm_sim import Recording
from arm_sim.replay import replay
from arm_sim.ros import SimNode, node_library
from arm_sim.ros.commands.latest import POLICIES
from arm_sim.ros.timing.histogram import Histogram
from arm_sim.ros.timing.realtime_loop import Due

pytestmark = pytest.mark.ros

TIMEOUT = 5  # ticks that a command acts
WIRE = Path(__file__).parents[2] / "support/wire.c"
PATIENCE = 60  # ticks between two orders, at most


class Wire(Structure):
    """``wire_t`` of wire.c."""

    _fields_ = Header(WIRE, only="wire_t").fields("wire_t")


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch) -> CDLL:
    """The native code of the nodes, whose messages come by ``wire.c``."""
    made = node_library.library(WIRE)
    made.left_on_wire.argtypes, made.left_on_wire.restype = [c_void_p], c_int64
    for user in ("tick_engine", "outputs"):
        monkeypatch.setattr(f"arm_sim.ros.{user}.library", lambda: made)
    monkeypatch.setattr("arm_dynamics.ros.joint_state.reader.library", lambda: made)
    return made


class Sim:
    """A node with its messages."""

    def __init__(self, ros: Ros, library: CDLL, scene: Any, path: Path) -> None:
        self.node: SimNode = by_hand(
            ros, scene, command_timeout=TIMEOUT * 1e-3, record=str(path), time="sim"
        )
        self._library, self.path, self.told = library, path, list[str]()
        self.node.inputs._warn = self.told.append
        self.lateness = Histogram()
        self._due = Due(give_up=10**12, lateness=addressof(self.lateness))
        newest: Any = self.node.inputs.polled._subscription
        self._to = newest.pointer

    def hears(self, messages: list[bytes]) -> None:
        """Let these come from now on; the last one ends ticks by the clock."""
        self._raw = b"".join(messages)
        self._ends = np.cumsum([len(message) for message in messages], dtype=np.int64)
        raw, place = np.frombuffer(self._raw or b"\0", np.uint8), addressof(self._due)
        wire = Wire(
            self._to, raw.ctypes.data, self._ends.ctypes.data, len(messages), 0,
            place + Due.ended.offset, address(self.node.outputs.states.raw),
        )  # fmt: skip
        self._library.put_on_wire(byref(wire))

    def lives(self) -> int:
        """Make ticks by the clock until all has come, or time stands still; their number."""
        engine, before = self.node.engine, self.lateness.percentiles().count
        stop = lambda: setattr(self._due, "ended", 1)  # noqa: E731
        engine.on.idle.append(stop)
        self._due.ended = 0
        engine.run(self._library.ticks_by_the_clock, byref(self._due))
        engine.on.idle.remove(stop)
        return self.lateness.percentiles().count - before

    def ticks(self, count: int) -> None:
        """As many ticks by hand."""
        for _ in range(count):
            self.node.tick()

    @property
    def everything(self) -> dict[str, Any]:
        """All that an order or a command may change."""
        node = self.node
        engine, simulator, slot = node.engine, node.simulator, node.engine.commands
        arbiter, inputs = engine.arbiter, node.inputs
        return {
            "time": simulator.arm.step_count, "state": simulator.arm.x.tobytes(),
            "acted": simulator.arm.acted.tobytes(),
            "parameters": simulator.arm.parameters.tobytes(),
            "commands": (slot.any, slot.age, slot.stale, slot.stale_count),
            "next": str(next_command(slot, simulator.arm.x[:2])),
            "sources": [(k, s.joints, s.last_time, s.count) for k, s in arbiter._streams.items()],
            "arbiter": (arbiter.now, arbiter.refused, arbiter.conflict, arbiter.last_refusal),
            "refused": (inputs.refused, inputs.refused_wrenches),
            "engine": (engine.paused, engine.failure, engine.held, engine.wrenches.active),
            "told": self.told,
        }  # fmt: skip


def command(rng: np.random.Generator, stamp: int) -> bytes:
    """A message that is mostly an ordinary command; empty: there is none at this moment."""
    way, efforts = rng.random(), (*rng.uniform(-2.0, 2.0, 2).tolist(),)
    if way < 0.5:
        return b""
    told = JointState(name=NAMES, effort=efforts)
    told.header.frame_id, told.header.stamp = "leader", to_time(stamp)
    if way > 0.99:
        told.name, told.effort = NAMES[:1], efforts[:1]
    elif way > 0.985:
        told.effort = [1e4, -1e4]
    elif way > 0.98:
        told.header.frame_id = "another"
    elif way > 0.97:
        told.effort = [float(rng.choice([np.nan, np.inf])), 0.0]
    elif way > 0.965:
        told.position, told.effort = efforts, []
    raw = bytes(serialize_message(told))
    return bent(rng, raw) if 0.95 < way <= 0.965 else raw


Order = Callable[[Sim], Any]


def asked(service: Any, **fields: Any) -> Order:
    """A request; what is answered."""
    request = service.type.Request(**fields)

    def ask(sim: Sim) -> Any:
        return str(sim.node.requests.answer(service, request))

    return ask


def tuned(**values: Any) -> Order:
    """Parameters; whether they were taken."""
    wanted = [Parameter(name, value=value) for name, value in values.items()]
    return lambda sim: str(sim.node.set_parameters_atomically(wanted))


def order(rng: np.random.Generator) -> Order:
    """A request to a sim between two ticks, sometimes an invalid one."""
    two, wild = rng.uniform(-1.0, 1.0, 2).tolist(), float(rng.choice([1.0, 1.0, 1.0, np.nan]))
    numbers = Float64MultiArray(data=[wild * x for x in two[: rng.choice([2, 2, 1])]])
    frame = str(rng.choice(["tip", "tip", "toe"]))  # without padding, which may hold anything
    push = pushed(frame, *rng.normal(size=5), wild)
    all_of_them: tuple[Order, ...] = (
        asked(interfaces.RESET),
        asked(interfaces.RESET),
        asked(interfaces.RESET_COUNTERS),
        asked(interfaces.PAUSE, data=bool(rng.random() < 0.3)),
        asked(interfaces.PAUSE, data=False),
        asked(interfaces.STEP, steps=int(rng.choice([0, 1, 7, 10_001]))),
        asked(interfaces.SET_JOINT_STATE, position=[wild * x for x in two]),
        asked(interfaces.SET_JOINT_STATE, joint_names=NAMES[1:], velocity=two[:1]),
        asked(interfaces.SET_PAYLOAD, index=0, mass=2.0 * two[0], com=[0.0, 0.0, 0.1]),
        asked(interfaces.SET_FRICTION, viscous=two),
        tuned(command_timeout=float(rng.choice([0.0, TIMEOUT * 1e-3, 0.02, -1.0]))),
        tuned(stale_policy=str(rng.choice([*POLICIES, "none"]))),
        lambda sim: sim.node.inputs.on_commands(numbers),
        lambda sim: sim.node.inputs.on_wrench(push),
        lambda sim: [found.message(sim.node).message for found in sim.node.diagnostics()],
    )
    return all_of_them[rng.integers(len(all_of_them))]


def test_orders_and_commands_in_any_sequence(
    ros: Ros, library: CDLL, tmp_path: Path, rng: np.random.Generator, fuzz: int
) -> None:
    """In the second half somebody hears energies, too."""
    load = {"frame": "tip", "mass": 0.1, "com": [0.0] * 3, "inertia": [0.0] * 6}
    scene = models.scene("two_link").model_dump(exclude_unset=True)
    scene["joints"] = {"*": {"limits": {"effort": 5.0}}}
    scene |= {"payloads": [load], "tunable": ["payload", "friction"]}
    fast, slow = (Sim(ros, library, scene, tmp_path / f"{k}.mcap") for k in range(2))
    outputs = [sim.node.outputs for sim in (fast, slow)]
    for turn in range(120 * fuzz):
        if turn == 60 * fuzz:
            ros.listen(Energy, "sim/energy")
            ros.spin_until(lambda: all(each.energy.has_subscribers for each in outputs))
        stamp = fast.node.engine.stamp
        messages = [command(rng, stamp) for _ in range(rng.integers(1, PATIENCE))]
        for sim in fast, slow:
            sim.hears(messages)
        slow.ticks(fast.lives())
        assert fast.everything == slow.everything
        wanted = order(rng)
        assert wanted(fast) == wanted(slow)
        assert fast.everything == slow.everything
    for sim in fast, slow:
        assert sim.node.recorder is not None and sim.node.recorder.lost == 0
        sim.node.recorder.close()
    told, expected = contents(fast.path), contents(slow.path)
    assert told.keys() == expected.keys()
    name, other = fast.path.name.encode(), slow.path.name.encode()
    padded = {"/sim/commands", "/sim/energy"}  # padding may hold anything
    for topic in told.keys() - padded:
        assert [raw.replace(name, other) for raw in told[topic]] == expected[topic]
    energies, wanted_energies = (
        [deserialize_message(raw, Energy) for raw in found.get("/sim/energy", [])]
        for found in (told, expected)
    )
    assert energies == wanted_energies and energies
    assert replay(Recording.load(fast.path)).equal
