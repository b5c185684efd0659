# SPDX-License-Identifier: Apache-2.0
"""Services answered by C: what they leave to Python; ``test_fuzz.py`` compares their answers."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from harness import Ros
from std_msgs.msg import String

import models
from arm_dynamics import Dynamics, load_scene
from arm_dynamics.codegen.compiler import find_compiler
from arm_dynamics.exceptions import KernelError
from arm_dynamics.ros import DynamicsNode
from arm_dynamics.ros.dynamics import compiled_services
from arm_dynamics.ros.dynamics.answers import ANSWERS
from arm_dynamics.ros.dynamics_node import node as dynamics_node
from arm_dynamics.ros.interfaces import FORWARD_DYNAMICS, INVERSE_DYNAMICS, Service
from arm_dynamics.scene.schema import Scene
from tolerances import PINOCCHIO, assert_close

pytestmark = [pytest.mark.ros, pytest.mark.skipif(find_compiler() is None, reason="no C compiler")]

TWO_LINK = (models.SCENES / "two_link.urdf").read_text()
SPRING = {"stiffness": 9.0, "damping": 0.5}
LOAD = {"at": [0.0, 5.0], "factor": [1.0, 1.2]}
PATIENCE = 60.0  # [s]
Ask = Callable[..., Any]


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile at the first request."""
    monkeypatch.setattr(compiled_services, "MIN_CALLS", 1)


@pytest.fixture
def ask(ros: Ros) -> Ask:
    """Calls a service of the node by ROS."""

    def asked(service: Service, **fields: Any) -> Any:
        name = service.name.replace("~", "/dynamics")
        return ros.call(service.type, name, service.type.Request(**fields))

    return asked


def in_c(node: DynamicsNode) -> int:
    """How many requests C has answered."""
    assert node._compiled is not None, "services.c was not compiled"
    return node._compiled.counts.answered


def warm(node: DynamicsNode, ask: Ask, *services: Service) -> None:
    """Ask until C answers."""
    for service in services:
        before, end = in_c(node), time.monotonic() + PATIENCE
        while in_c(node) == before:
            assert time.monotonic() < end, "C does not answer"
            n = node.dynamics.n
            assert ask(service, position=[0.1] * n, velocity=[0.1] * n).success


def expected(dynamics: Dynamics, service: Service, **fields: Any) -> Any:
    """What Python answers."""
    response = service.type.Response()
    ANSWERS[service](dynamics, service.type.Request(**fields), response)
    return response


def with_friction(**law: Any) -> Scene:
    """Two links whose elbow has a spring and friction."""
    elbow = {"spring": SPRING, "friction": {"coulomb": 0.4, **law}}
    return load_scene({"robot": {"urdf": TWO_LINK}, "joints": {"elbow": elbow}})


def test_a_joint_that_may_stick_at_rest_is_for_python(ros: Ros, ask: Ask) -> None:
    node = ros.add(DynamicsNode, with_friction(static=0.6, viscous=0.1))
    warm(node, ask, FORWARD_DYNAMICS)
    before = in_c(node)
    # Standing upright, the elbow's spring at rest: it is held.
    fields = {"position": [np.pi / 2, 0.0], "velocity": [0.3, 0.0], "effort": [0.0, 0.0]}
    answer = ask(FORWARD_DYNAMICS, **fields)
    assert in_c(node) == before
    assert answer.acceleration == expected(node.dynamics, FORWARD_DYNAMICS, **fields).acceleration


def test_friction_by_load_is_for_python(ros: Ros, ask: Ask) -> None:
    node = ros.add(DynamicsNode, with_friction(load=LOAD))
    fields = {"position": [0.2, 0.3], "velocity": [0.1, 0.1], "acceleration": [1.0, 2.0]}
    wanted = expected(node.dynamics, INVERSE_DYNAMICS, **fields)
    for _ in range(5):
        assert ask(INVERSE_DYNAMICS, **fields).effort == wanted.effort
    assert in_c(node) == 0


def test_another_arm_is_answered_for_at_once(ros: Ros, ask: Ask) -> None:
    node = ros.add(DynamicsNode, robot_description=TWO_LINK)
    warm(node, ask, INVERSE_DYNAMICS)
    heavy = TWO_LINK.replace('mass value="', 'mass value="1')
    assert heavy != TWO_LINK
    before = ask(INVERSE_DYNAMICS, position=[0.1, 0.2]).effort
    node.on_robot_description(String(data=heavy))
    after = ask(INVERSE_DYNAMICS, position=[0.1, 0.2])
    wanted = expected(node.dynamics, INVERSE_DYNAMICS, position=[0.1, 0.2])
    assert after.effort == wanted.effort  # by Python, to the bit
    assert abs(np.subtract(after.effort, before)).max() > 1.0
    warm(node, ask, INVERSE_DYNAMICS)
    assert_close(ask(INVERSE_DYNAMICS, position=[0.1, 0.2]).effort, wanted.effort, PINOCCHIO)


def test_without_headers_python_answers(
    ros: Ros, ask: Ask, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing() -> None:
        raise KernelError("no headers")

    monkeypatch.setattr(dynamics_node, "native", missing)
    node = ros.add(DynamicsNode, models.scene("two_link"))
    assert node._compiled is None
    assert ask(INVERSE_DYNAMICS, position=[0.1, 0.2]).success
    (finding,) = node.diagnostics()
    assert finding.values["answered in C"] == "none, there is no compiled code"
