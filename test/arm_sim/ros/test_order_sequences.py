# SPDX-License-Identifier: Apache-2.0
"""Requests and commands in any sequence: a sim by the clock equals one by hand, and a recording
says what the running node said.

``--fuzz N`` makes the test N times as long; ``tools/sanitize.py`` runs it under sanitizers.
"""

from collections.abc import Callable
from ctypes import CDLL, Structure, addressof, byref, c_int64, c_void_p
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arm_msgs.msg import Energy
from bent_messages import bent
from harness import Ros
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from recorded_engine import contents
from recorded_engine import scene as above_a_table
from samples import always
from sensor_msgs.msg import JointState
from sim_by_hand import by_hand, next_command, pushed
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
from arm_sim.simulation.energy_meter import Account
from models import features

pytestmark = pytest.mark.ros

TIMEOUT = 5  # ticks that a command acts
WIRE = Path(__file__).parents[2] / "support/wire.c"
PATIENCE = 60  # ticks between two orders, at most
PLAIN = models.scene("two_link").model_dump(exclude_unset=True)
LOAD = {"frame": "tip", "mass": 0.1, "com": [0.0] * 3, "inertia": [0.0] * 6}
LIMITS = {"effort": 5.0, "lower": -1.5, "upper": 1.5}
KINDS: dict[str, dict[str, Any]] = {
    "plain": PLAIN,  # nothing of it is tunable
    "tunable": PLAIN | {"joints": {"*": {"limits": LIMITS, "friction": {"viscous": 0.3}}},
                        "payloads": [LOAD], "tunable": ["payload", "friction"]},
    "dry friction above a table": above_a_table(),
} | {
    ", ".join(parts): features.scene("planar", parts)
    for parts in (
        ("coulomb", "contact", "payload"), ("lugre", "end stop", "mimic"), ("current", "voltage"),
        ("bilateral", "viscous", "payload"), ("bilateral", "coulomb", "contact"),
        ("flexible", "harmonic", "end stop"), ("lossy gear", "coulomb", "spring", "point spring"),
        ("lugre", "contact", "voltage", "payload"),
    )  # fmt: skip
}  # fmt: skip
EXACT = 1e-9  # of the energy that moved


class Wire(Structure):
    """``wire_t`` of wire.c."""

    _fields_ = Header(WIRE, only="wire_t").fields("wire_t")


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch) -> CDLL:
    """The native code of the nodes, whose messages come by ``wire.c``; it keeps few energies."""
    monkeypatch.setattr("arm_sim.ros.energy_trail.ROWS", 20)
    made = node_library.library(WIRE)
    made.left_on_wire.argtypes, made.left_on_wire.restype = [c_void_p], c_int64
    for user in ("tick_engine", "outputs"):
        monkeypatch.setattr(f"arm_sim.ros.{user}.library", lambda: made)
    monkeypatch.setattr("arm_dynamics.ros.joint_state.reader.library", lambda: made)
    return made


class Sim:
    """A node with its messages, and its energy account from each reset to the next.

    Attributes:
        spans: First and last tick of each account, counted from the start, and what it said.
    """

    def __init__(self, ros: Ros, library: CDLL, scene: Any, path: Path) -> None:
        self.node: SimNode = by_hand(
            ros, scene, command_timeout=TIMEOUT * 1e-3, record=str(path), time="sim"
        )
        self._library, self.path, self.told = library, path, list[str]()
        self.node.inputs._warn = self.told.append
        self.lateness = Histogram()
        self._due = Due(longest_lag=10**12, lateness=addressof(self.lateness))
        newest: Any = self.node.inputs.polled._subscription
        self._to = newest.pointer
        self.names = list(self.node.simulator.joint_names)
        self.spans = list[tuple[int, int, Account]]()

    def open(self) -> None:
        """Begin an account."""
        self.node.engine.energy.set_open(True)
        self._since = self.node.recorder.ticks

    def read(self) -> None:
        """Read the account, if there is one."""
        if (account := self.node.engine.energy.read()) is not None:
            self.spans.append((self._since, self.node.recorder.ticks, account))

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
            "commands": (slot.was_sent, slot.age, slot.stale, slot.stale_count),
            "next": str(next_command(slot, simulator.arm.x[: simulator.n])),
            "sources": [(k, s.joints, s.last_time, s.count) for k, s in arbiter._streams.items()],
            "arbiter": (arbiter.now, arbiter.refused, arbiter.has_conflict, arbiter.last_refusal),
            "refused": (inputs.refused, inputs.refused_wrenches),
            "engine": (engine.paused, engine.failure, engine.held, engine.wrenches.active),
            "told": self.told,
        }  # fmt: skip


def command(rng: np.random.Generator, names: list[str], stamp: int) -> bytes:
    """A message that is mostly an ordinary command; empty: there is none at this moment."""
    way, efforts = rng.random(), rng.uniform(-2.0, 2.0, len(names)).tolist()
    if way < 0.5:
        return b""
    told = JointState(name=names, effort=efforts)
    told.header.frame_id, told.header.stamp = "leader", to_time(stamp)
    if way > 0.99:
        told.name, told.effort = names[:1], efforts[:1]
    elif way > 0.985:
        told.effort = [1e4 * effort for effort in efforts]
    elif way > 0.98:
        told.header.frame_id = "another"
    elif way > 0.97:
        told.effort = [float(rng.choice([np.nan, np.inf])), *efforts[1:]]
    elif way > 0.965:
        told.position, told.effort = efforts, []
    elif way > 0.96:
        told.velocity, told.effort = efforts, []
    raw = bytes(serialize_message(told))
    return bent(rng, raw) if 0.945 < way <= 0.96 else raw


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


def reset(sim: Sim) -> Any:
    """Reset, which begins another account."""
    kept = sim.node.engine.energy.is_open
    sim.read()
    answer = asked(interfaces.RESET)(sim)
    if kept:
        sim.open()
    return answer


def order(rng: np.random.Generator, names: list[str], frame: str) -> Order:
    """A request to a sim between two ticks, sometimes an invalid one."""
    some, wild = rng.uniform(-1.0, 1.0, len(names)), float(rng.choice([1.0, 1.0, 1.0, np.nan]))
    few, near = some.tolist(), float(rng.choice([1.0, 0.02]))
    numbers = Float64MultiArray(data=(wild * some)[: rng.choice([9, 9, 1])].tolist())
    push = pushed(str(rng.choice([frame, frame, "toe"])), *rng.normal(size=5), wild)

    def place(sim: Sim) -> Any:
        there = np.clip(sim.node.simulator.state.q + near * some, -1.5, 1.5)
        return asked(interfaces.SET_JOINT_STATE, position=there.tolist(), velocity=few)(sim)

    all_of_them: tuple[Order, ...] = (
        reset,
        Sim.read,
        place,
        asked(interfaces.RESET_COUNTERS),
        asked(interfaces.PAUSE, data=bool(rng.random() < 0.3)),
        asked(interfaces.PAUSE, data=False),
        asked(interfaces.STEP, steps=int(rng.choice([0, 1, 7, 10_001]))),
        asked(interfaces.SET_JOINT_STATE, position=(wild * some).tolist()),
        asked(interfaces.SET_JOINT_STATE, joint_names=names[1:2], velocity=few[:1]),
        asked(interfaces.SET_PAYLOAD, index=0, mass=2.0 * few[0], com=[0.0, 0.0, 0.1]),
        asked(interfaces.SET_FRICTION, viscous=few),
        asked(interfaces.SET_FRICTION, viscous=np.abs(some).tolist()),
        tuned(command_timeout=float(rng.choice([0.0, TIMEOUT * 1e-3, 0.02, -1.0]))),
        tuned(stale_policy=str(rng.choice([*POLICIES, "none"]))),
        lambda sim: sim.node.inputs.on_commands(numbers),
        lambda sim: sim.node.inputs.on_wrench(push),
        lambda sim: [found.message(sim.node).message for found in sim.node.diagnostics()],
    )
    return all_of_them[rng.integers(len(all_of_them))]


@pytest.mark.parametrize("kind", always(KINDS, *list(KINDS)[1:3], list(KINDS)[-1]))
def test_orders_and_commands_in_any_sequence(
    ros: Ros, library: CDLL, tmp_path: Path, rng: np.random.Generator, fuzz: int, kind: str
) -> None:
    """In the second half somebody hears energies, too."""
    fast, slow = (Sim(ros, library, KINDS[kind], tmp_path / f"{k}.mcap") for k in range(2))
    outputs = [sim.node.outputs for sim in (fast, slow)]
    frame = "forearm" if "forearm" in fast.node.simulator.model.pin.names else "link3"
    for turn in range(120 * fuzz):
        if turn == 60 * fuzz:
            ros.listen(Energy, "sim/energy")
            ros.spin_until(lambda: all(each.energy.has_subscribers for each in outputs))
            fast.open(), slow.open()
        stamp = fast.node.engine.stamp
        messages = [command(rng, fast.names, stamp) for _ in range(rng.integers(1, PATIENCE))]
        for sim in fast, slow:
            sim.hears(messages)
        slow.ticks(fast.lives())
        assert fast.everything == slow.everything
        wanted = order(rng, fast.names, frame)
        assert wanted(fast) == wanted(slow)
        assert fast.everything == slow.everything
    for sim in fast, slow:
        sim.read()
        assert sim.node.recorder is not None and sim.node.recorder.lost == 0
        sim.node.recorder.close()
    assert_same_messages(fast.path, slow.path)
    recording = Recording.load(fast.path)
    found = replay(recording)
    assert found.equal, found.first or found.failure
    assert fast.spans
    for first, last, told in fast.spans:
        assert_same_account(recording, first, last, told)
    again = Recording.load(recording.save(tmp_path / "again.mcap"))
    assert replay(again).equal
    np.testing.assert_allclose(again.balance, recording.balance, atol=1e-12)


def assert_same_messages(path: Path, other: Path) -> None:
    """Assert that two files have the same messages, among them energies."""
    told, expected = contents(path), contents(other)
    assert told.keys() == expected.keys()
    padded = {"/sim/commands", "/sim/wrench", "/sim/energy"}  # padding may hold anything
    for topic in told.keys() - padded:
        named = [raw.replace(path.name.encode(), other.name.encode()) for raw in told[topic]]
        assert named == expected[topic]
    energies, wanted = (
        [deserialize_message(raw, Energy) for raw in found["/sim/energy"]]
        for found in (told, expected)
    )
    assert energies == wanted and energies


def assert_same_account(recording: Recording, first: int, last: int, told: Account) -> None:
    """Assert that energies of a recording between two rows are those that a node told."""
    rows = slice(first, last + 1)
    parts = (
        recording.kinetic, recording.potential, recording.stored,
        recording.supplied, recording.lost, recording.changed,
    )  # fmt: skip
    moved = sum(float(np.ptp(part[rows])) for part in parts)
    rounding = 8.0 * np.spacing(max(float(abs(part).max()) for part in parts))
    found = [np.diff(part[[first, last]])[0] for part in (
        recording.balance, recording.supplied, recording.lost
    )]  # fmt: skip
    wanted = [told.balance, told.input, told.dissipated]
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=EXACT * moved + rounding)
