# SPDX-License-Identifier: Apache-2.0
"""Whatever is ordered between ticks, a recording of them says what the running node said."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness import Ros
from pushes import pushed
from rclpy.parameter import Parameter
from recorded_engine import scene
from samples import always
from sim_by_hand import Waiting, by_hand, command, ticks

import models
from arm_dynamics.ros import interfaces
from arm_sim import Recording
from arm_sim.replay import replay
from arm_sim.ros.commands.latest import POLICIES
from arm_sim.simulation.energy_meter import Account
from models import features

pytestmark = pytest.mark.ros

PLAIN = models.scene("two_link").model_dump(exclude_unset=True)
LOAD = {"frame": "tip", "mass": 0.1, "com": [0.0] * 3, "inertia": [0.0] * 6}
JOINTS = {"*": {"friction": {"viscous": 0.3}, "limits": {"lower": -1.5, "upper": 1.5}}}
KINDS: dict[str, dict[str, Any]] = {
    "plain": PLAIN,  # nothing of it is tunable
    "tunable": PLAIN | {"joints": JOINTS, "payloads": [LOAD], "tunable": ["payload", "friction"]},
    "dry friction above a table": scene(),
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


class Live:
    """A node that records itself, and its account from each reset to the next.

    Attributes:
        spans: First and last tick of each account, counted from the start, and what it said.
        pushed: Frame on which wrenches act.
    """

    def __init__(self, ros: Ros, given: dict[str, Any], path: Path) -> None:
        self.node = by_hand(ros, given, record=str(path), command_timeout=0.01)
        self._commands, self.made = Waiting(self.node), 0
        self.node.outputs.energy._also_read = lambda: True
        self.node.engine.on.tick.append(self._count)
        self.spans = list[tuple[int, int, Account]]()
        self.pushed = "forearm" if "forearm" in self.node.simulator.model.pin.names else "link3"
        self._open()

    def _count(self) -> None:
        self.made += 1

    def _open(self) -> None:
        self.node.engine.energy.keep(True)
        self._since = self.made

    def read(self) -> None:
        """Read the account."""
        account = self.node.engine.energy.read()
        assert account is not None
        self.spans.append((self._since, self.made, account))

    def ask(self, service: Any, **fields: Any) -> None:
        """Send a request, which may be refused."""
        self.node.requests.answer(service, service.type.Request(**fields))

    def reset(self) -> None:
        """Reset, which begins another account."""
        self.read()
        self.ask(interfaces.RESET)
        self._open()

    def follow(self, count: int, **fields: Any) -> None:
        """Tick under commands."""
        for _ in range(count):
            names = self.node.simulator.joint_names
            self._commands.messages.append(command(name=names, **fields))
            ticks(self.node, 1)


def order(live: Live, rng: np.random.Generator) -> str:
    """Give an order drawn at random, and let some ticks pass; the order's name."""
    node, names = live.node, list(live.node.simulator.joint_names)
    q, some = node.simulator.state.q, rng.uniform(-1.0, 1.0, len(names))
    near, few = (
        np.clip(q + rng.choice([1.0, 0.02]) * some, -1.5, 1.5).tolist(),
        int(rng.integers(1, 9)),
    )
    speed, two = some.tolist(), some[:2].tolist()
    policy = Parameter("stale_policy", value=str(rng.choice(POLICIES)))
    all_of_them: dict[str, Callable[[], Any]] = {
        "read": live.read,
        "reset": live.reset,
        "place": lambda: live.ask(interfaces.SET_JOINT_STATE, position=near, velocity=speed),
        "place one": lambda: live.ask(
            interfaces.SET_JOINT_STATE, joint_names=names[1:2], velocity=two[:1]
        ),
        "pause": lambda: live.ask(interfaces.PAUSE, data=True),
        "resume": lambda: live.ask(interfaces.PAUSE, data=False),
        "go on": lambda: live.ask(interfaces.PAUSE, data=False),
        "step": lambda: live.ask(interfaces.STEP, steps=few),
        "load": lambda: live.ask(interfaces.SET_PAYLOAD, mass=abs(two[0]), com=[0.0, 0.0, 0.1]),
        "friction": lambda: live.ask(interfaces.SET_FRICTION, viscous=np.abs(some).tolist()),
        "policy": lambda: node.set_parameters([policy]),
        "push": lambda: node.inputs.on_wrench(pushed(live.pushed, *two, *rng.normal(size=4))),
        "efforts": lambda: live.follow(few, effort=speed),
        "positions": lambda: live.follow(few, position=near),
        "velocities": lambda: live.follow(1, velocity=speed),
    }  # fmt: skip
    name = str(rng.choice(list(all_of_them)))
    all_of_them[name]()
    ticks(node, int(rng.choice([0, 1, 12, 30])))
    return name


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


@pytest.mark.parametrize("turn", always(range(len(KINDS)), 2, len(KINDS) - 1), ids=KINDS)
def test_a_recording_has_states_and_account_of_the_node(
    ros: Ros, tmp_path: Path, rng: np.random.Generator, turn: int
) -> None:
    live = Live(ros, list(KINDS.values())[turn], tmp_path / "run.mcap")
    given = {order(live, rng) for _ in range(150)}
    assert len(given) == 15  # each kind of order
    live.read()
    assert live.node.recorder is not None and live.node.engine.failure == ""
    live.node.recorder.close()
    recording = Recording.load(tmp_path / "run.mcap")
    assert len(recording) == live.made + 1 > 1000 and not recording.gaps
    found = replay(recording)
    assert found.equal, found.first or found.failure
    for first, last, told in live.spans:
        assert_same_account(recording, first, last, told)
    again = Recording.load(recording.save(tmp_path / "again.mcap"))
    assert replay(again).equal
    np.testing.assert_allclose(again.balance, recording.balance, atol=1e-12)
