# SPDX-License-Identifier: Apache-2.0
"""Messages that are bent at random: C reads and answers as Python does, or leaves it to Python.

``--fuzz N`` makes the tests N times as long; ``tools/sanitize.py`` runs them under sanitizers.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest
from harness import Ros
from rclpy.serialization import serialize_message
from readers import said
from sensor_msgs.msg import JointState

import models
from arm_dynamics import load_scene
from arm_dynamics.codegen.compiler import find_compiler
from arm_dynamics.ros.dynamics import COMPILED, compiled_services
from arm_dynamics.ros.dynamics_node import DynamicsNode
from arm_dynamics.ros.joint_state.serialization import JointStateReader
from arm_dynamics.ros.joint_state.topics import CompiledReader, make_reader
from tolerances import PINOCCHIO, assert_close

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
]

NAMES = ["base", "elbow", "wrist_é"]
LENGTHS = (0, 1, 3, 4, 2**16, 2**24 + 1, 2**31 - 1, 2**31, 2**32 - 8, 2**32 - 1)
ROOM = 0.3  # of requests that C may answer


def bent(rng: np.random.Generator, raw: bytes) -> bytes:
    """A message with damaged bytes, hostile lengths, pieces too few or too many, or all of it."""
    made = bytearray(raw)
    for way in rng.integers(5, size=rng.integers(1, 4)):
        at = int(rng.integers(len(made) + 1)) if made else 0
        if way == 0 and at < len(made):
            made[at] ^= int(rng.integers(1, 256))
        elif way == 1:
            made = made[:at]
        elif way == 2:
            made[at:at] = rng.bytes(int(rng.integers(1, 9)))
        elif way == 3:
            at -= at % 4
            made[at : at + 4] = struct.pack("<I", int(rng.choice(LENGTHS)))
        else:
            made += made[at:]
    return bytes(made)


@pytest.mark.parametrize("gaps", [False, True])
def test_bent_joint_states(rng: np.random.Generator, fuzz: int, gaps: bool) -> None:
    options: dict[str, Any] = {"partial": gaps, "extra": gaps, "gaps": gaps}
    fields = ("position", "velocity", "effort")
    python = JointStateReader(NAMES, fields, **options)
    compiled = make_reader(NAMES, fields, **options)
    assert isinstance(compiled, CompiledReader)
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
    monkeypatch.setattr(compiled_services, "WORTH", 1)
    urdf = {"urdf": (models.SCENES / "two_link.urdf").read_text()}
    dry = {"elbow": {"friction": {"coulomb": 0.4, "static": 0.6}}}
    node = ros.add(DynamicsNode, load_scene({"robot": urdf, "joints": dry}))
    assert node._compiled is not None
    clients = {
        service: ros.peer.create_client(service.type, service.name.replace("~", "/dynamics"))
        for service, *_ in COMPILED
    }
    for client in clients.values():
        ros.spin_until(client.service_is_ready)
    names = list(node.dynamics.joint_names)
    for service, client in clients.items():
        while service not in node._compiled.compiled:
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
