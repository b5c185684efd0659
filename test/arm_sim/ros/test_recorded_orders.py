# SPDX-License-Identifier: Apache-2.0
"""Whatever is ordered between ticks, a recording of them says what the running node said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness import Ros
from pushes import pushed
from rclpy.parameter import Parameter
from recorded_engine import scene
from samples import sampled
from sim_by_hand import NAMES, Waiting, by_hand, command, ticks

import models
from arm_dynamics.ros import interfaces
from arm_sim import Recording
from arm_sim.energy_meter import Account
from arm_sim.replay import replay
from arm_sim.ros.commands.latest import POLICIES

pytestmark = pytest.mark.ros

PLAIN = models.scene("two_link").model_dump(exclude_unset=True)
LOAD = {"frame": "tip", "mass": 0.1, "com": [0.0] * 3, "inertia": [0.0] * 6}
JOINTS = {"*": {"friction": {"viscous": 0.3}, "limits": {"lower": -1.5, "upper": 1.5}}}
SCENES: tuple[dict[str, Any], ...] = (
    PLAIN,  # nothing of it is tunable
    PLAIN | {"joints": JOINTS, "payloads": [LOAD], "tunable": ["payload", "friction"]},
    scene(),
)
EXACT = 1e-9  # of the energy that moved


class Live:
    """A node that records itself, and its account from each reset to the next.

    Attributes:
        spans: First and last tick of each account, counted from the start, and what it said.
    """

    def __init__(self, ros: Ros, given: dict[str, Any], path: Path) -> None:
        self.node = by_hand(ros, given, record=str(path), command_timeout=0.01)
        self._commands, self.made = Waiting(self.node), 0
        self.node._outputs.energy._wanted = lambda: True
        self.node.engine.on_tick.append(self._count)
        self.spans = list[tuple[int, int, Account]]()
        self._open()

    def _count(self) -> None:
        self.made += 1

    def _open(self) -> None:
        self.node.engine.keep_account(True)
        self._since = self.made

    def read(self) -> None:
        """Read the account."""
        account = self.node.engine.account()
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
            self._commands.messages.append(command(name=NAMES, **fields))
            ticks(self.node, 1)


def order(live: Live, rng: np.random.Generator) -> None:
    """Give an order drawn at random, and let some ticks pass."""
    q, two = live.node.simulator.state.q, rng.uniform(-1.0, 1.0, 2).tolist()
    near, few = np.clip(q + two, -1.5, 1.5).tolist(), int(rng.integers(1, 9))
    policy = Parameter("stale_policy", value=str(rng.choice(POLICIES)))
    all_of_them = (
        live.read,
        live.reset,
        lambda: live.ask(interfaces.SET_JOINT_STATE, position=near, velocity=two),
        lambda: live.ask(interfaces.SET_JOINT_STATE, joint_names=NAMES[1:], velocity=two[:1]),
        lambda: live.ask(interfaces.PAUSE, data=True),
        lambda: live.ask(interfaces.PAUSE, data=False),
        lambda: live.ask(interfaces.PAUSE, data=False),
        lambda: live.ask(interfaces.STEP, steps=few),
        lambda: live.ask(interfaces.SET_PAYLOAD, mass=abs(two[0]), com=[0.0, 0.0, 0.1]),
        lambda: live.ask(interfaces.SET_FRICTION, viscous=np.abs(two).tolist()),
        lambda: live.node.set_parameters([policy]),
        lambda: live.node.inputs.on_wrench(pushed("forearm", *two, *rng.normal(size=4))),
        lambda: live.follow(few, effort=two),
        lambda: live.follow(few, position=near),
        lambda: live.follow(1, velocity=two),
    )
    all_of_them[rng.integers(len(all_of_them))]()
    ticks(live.node, int(rng.choice([0, 1, 12, 30])))


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


@pytest.mark.parametrize("turn", sampled(range(10), 3))  # each scene once
def test_a_recording_has_states_and_account_of_the_node(
    ros: Ros, tmp_path: Path, rng: np.random.Generator, turn: int
) -> None:
    live = Live(ros, SCENES[turn % len(SCENES)], tmp_path / "run.mcap")
    for _ in range(300):
        order(live, rng)
    live.read()
    assert live.node.recorder is not None and live.node.engine.failure == ""
    live.node.recorder.close()
    recording = Recording.load(tmp_path / "run.mcap")
    assert len(recording) == live.made + 1 > 1000 and not recording.gaps
    found = replay(recording)
    assert found.equal, found.first or found.failure
    for first, last, told in live.spans:
        assert_same_account(recording, first, last, told)
    assert recording.energy_error < 1e-6
    again = Recording.load(recording.save(tmp_path / "again.mcap"))
    assert replay(again).equal
    np.testing.assert_allclose(again.balance, recording.balance, atol=1e-12)
