# SPDX-License-Identifier: Apache-2.0
"""Messages corrupted at random: C reads and answers as Python does, or leaves it to Python.

``--fuzz N`` makes the tests N times as long; ``tools/sanitize.py`` runs them under sanitizers.
"""

from typing import Any

import numpy as np
import pytest
from bent_messages import bent
from controller_pair import MS, Pair, side_by_side
from harness import Ros
from rclpy.serialization import serialize_message
from readers import PlainReader, said
from samples import sampled
from sensor_msgs.msg import JointState

import models
from arm_dynamics import load_scene
from arm_dynamics.codegen.compiler import find_compiler
from arm_dynamics.ros import DynamicsNode
from arm_dynamics.ros.dynamics import compiled_services
from arm_dynamics.ros.joint_state import JointStateFormat, JointStateReader
from tolerances import PINOCCHIO, assert_close

pytestmark = [pytest.mark.ros, pytest.mark.skipif(find_compiler() is None, reason="no C compiler")]

NAMES = ["base", "elbow", "wrist_é"]
CONTROLLERS = ("computed_torque", "pd_gravity", "pid", "joint_impedance")
ROOM = 0.3  # of requests that C may answer


@pytest.mark.parametrize("gaps", [False, True])
def test_bent_joint_states(rng: np.random.Generator, fuzz: int, gaps: bool) -> None:
    fields = ("position", "velocity", "effort")
    expected = JointStateFormat(NAMES, fields, gaps, gaps, gaps)
    python, compiled = PlainReader(expected), JointStateReader(expected)
    message = JointState(name=NAMES)
    message.position, message.velocity, message.effort = rng.normal(size=(3, 3)).tolist()
    whole = bytes(serialize_message(message))
    for _ in range(400 * fuzz):
        raw = bent(rng, whole)
        assert said(compiled, raw) == said(python, raw)
        assert said(compiled, whole) == said(python, whole)


def request_of(rng: np.random.Generator, kind: Any, names: list[str]) -> Any:
    """A request that is often right, and else wrong in any way."""
    n = len(names)
    points = int(rng.choice([1, 1, 2, 5, 40]))
    request = kind.Request()
    if rng.random() < ROOM:
        drawn = rng.choice([*names, "nobody", ""], int(rng.integers(0, n + 2)))
        request.joint_names = drawn.tolist()
    for field, about in kind.Request.get_fields_and_field_types().items():
        if about != "sequence<double>":
            continue
        size = points * n if rng.random() < 0.9 else int(rng.integers(0, 4 * n))
        values = rng.normal(size=size) * rng.choice([0.0, 1.0, 1.0, 1e3])
        if size and rng.random() < 0.05:
            values[rng.integers(size)] = rng.choice([np.nan, np.inf, -np.inf, 1e308, 5e-324])
        setattr(request, field, [] if rng.random() < 0.1 else values.tolist())
    if hasattr(request, "terms"):
        request.terms = int(rng.integers(40))
    return request


def test_requests_of_any_kind(
    ros: Ros, rng: np.random.Generator, fuzz: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiled_services, "MIN_CALLS", 1)
    urdf = {"urdf": (models.SCENES / "two_link.urdf").read_text()}
    dry = {"elbow": {"friction": {"coulomb": 0.4, "static": 0.6}}}
    node = ros.add(DynamicsNode, load_scene({"robot": urdf, "joints": dry}))
    assert node._compiled is not None
    clients = {
        service: ros.peer.create_client(service.type, service.name.replace("~", "/dynamics"))
        for service, *_ in compiled_services.CANDIDATES
    }
    for client in clients.values():
        ros.spin_until(client.service_is_ready)
    names = list(node.dynamics.joint_names)
    for service, client in clients.items():
        while service not in (compiled_services.CANDIDATES[k][0] for k in node._compiled._answers):
            future = client.call_async(service.type.Request(position=[0.1] * len(names)))
            ros.spin_until(future.done)
    before = node._compiled.counts.answered
    for _ in range(100 * fuzz):
        for service, client in clients.items():
            request = request_of(rng, service.type, names)
            future = client.call_async(request)
            ros.spin_until(future.done)
            answer = future.result()
            wanted = node.answer(service, request, service.type.Response())
            assert (answer.success, answer.message) == (wanted.success, wanted.message)
            assert answer.joint_names == wanted.joint_names
            for field, about in answer.get_fields_and_field_types().items():
                if about == "sequence<double>":
                    assert_close(getattr(answer, field), getattr(wanted, field), PINOCCHIO)
    assert node._compiled.counts.answered > before + 30 * fuzz


def shown(pair: Pair, rng: np.random.Generator) -> None:
    """One more state: an ordinary one, or one that is bent, comes again, is late or far away."""
    way = rng.integers(12)
    pair.stamp += int(rng.choice([0, 1, 300, 2000])) * MS if way == 0 else MS
    step = rng.choice([0.01, 3.0, 1e200]) if way == 1 else 1e-3
    q, v = (x + rng.normal(0.0, step, x.size) for x in (pair.q, pair.v))
    if way == 2:
        pair.stamp -= int(rng.choice([1, 5000])) * MS
    raw = pair.state(q, v)
    pair.answers(bent(rng, raw) + bytes(4) if way == 3 else raw)
    if way == 4:
        pair.answers(raw)


def ordered(pair: Pair, rng: np.random.Generator) -> None:
    """Something that Python does between two states."""
    way = rng.integers(5)
    if way == 0:
        times = np.cumsum(rng.uniform(0.01, 0.1, rng.integers(1, 5)))
        pair.go(*((float(at), rng.normal(0.0, 0.02, pair.q.size)) for at in times))
    elif way == 1:
        pair.change(bandwidth=rng.uniform(1.0, 40.0, 1).tolist())
    elif way == 2:
        pair.change(controller=str(rng.choice(CONTROLLERS)))
    elif way == 3:
        pair.change(controller="computed_torque", jump_limit=float(rng.choice([0.0, 0.5])))
    else:
        pair.both(lambda node: node.diagnostics())


@pytest.mark.parametrize("saturate", sampled([True, False], 1))
def test_orders_and_states_in_any_sequence(
    ros: Ros, rng: np.random.Generator, fuzz: int, saturate: bool
) -> None:
    scene = models.scene("two_link")
    with side_by_side(ros, scene, switch_time=0.003, saturate=saturate) as pair:
        pair.build(*CONTROLLERS)
        for _ in range(500 * fuzz):
            if rng.random() < 0.1:
                ordered(pair, rng)
            shown(pair, rng)
        assert pair.in_c > 100 * fuzz
