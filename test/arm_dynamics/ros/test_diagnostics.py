# SPDX-License-Identifier: Apache-2.0
"""Diagnostics of the dynamics node and the controller node."""

import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from arm_msgs.srv import InverseDynamics
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from harness import Ros
from two_link_control import MS, effort, point, state, trajectory

import models
from arm_dynamics.ros import ControllerNode, DynamicsNode
from arm_dynamics.ros.controller import answer_log

pytestmark = pytest.mark.ros

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def found(node: Any) -> DiagnosticStatus:
    (finding,) = node.diagnostics()
    return finding.message(node)


def values(status: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}


def test_findings_are_published_and_two_nodes_of_one_name_named(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    """Either would answer requests to them; those of other names and namespaces do not matter."""
    scene = models.scene("two_link")
    ros.adopt(DynamicsNode(scene, context=ros.context, namespace="left"))
    one = ros.add(DynamicsNode, scene)
    heard = ros.listen(DiagnosticArray, "/diagnostics")

    def said() -> set[str]:
        found = {status.name: status.message for message in heard for status in message.status}
        heard.clear()
        return {name for name, words in found.items() if "two nodes are called /dynam" in words}

    ros.spin_until(lambda: len(heard) > 1)
    status = next(array.status[0] for array in heard if array.status[0].hardware_id == "/dynamics")
    assert (status.name, status.message, status.level) == ("dynamics: services", "ok", OK)
    assert values(status)["executor"] == type(one.executor).__name__
    assert not said()
    ros.add(DynamicsNode, scene)
    ros.spin_until(lambda: said() == {"dynamics: services"})
    assert "__node:=NAME" in capfd.readouterr().err
    assert one.diagnostics()[0].message(one).level == OK  # it is no fault of its own


def test_requests_are_counted_and_refusals_reported_once(ros: Ros) -> None:
    node = ros.add(DynamicsNode, models.scene("two_link"))
    for position in ([0.0, 0.0], [0.0], [0.1, 0.2], []):
        request = InverseDynamics.Request(position=position)
        ros.call(InverseDynamics, "/dynamics/inverse_dynamics", request)
    status = found(node)
    assert (status.level, status.message) == (WARN, "2 requests refused")
    assert (values(status)["requests"], values(status)["refused"]) == ("4", "2")
    assert 0.0 < float(values(status)["busy"]) < 1.0
    status = found(node)
    assert (status.level, status.message) == (OK, "ok")
    assert (values(status)["refused"], values(status)["busy"]) == ("2", "0")


def test_a_controller_reports_errors_since_the_last_report(ros: Ros) -> None:
    node = ros.add(ControllerNode, models.scene("two_link"), saturate=True)
    effort(node, 10 * MS, (0.0, 0.0))
    effort(node, 11 * MS, (0.0, 0.0))
    status = found(node)
    assert (status.level, status.name) == (OK, "controller: controller")
    assert values(status)["controller"] == "computed_torque"
    assert float(values(status)["rate [Hz]"]) > 0.0
    node.on_joint_states(b"rubbish")
    node.on_joint_trajectory(trajectory(point(1.0, np.nan, 0.0)))
    effort(node, 0, (0.0, 0.0))
    effort(node, MS, (0.3, 0.3))
    status = found(node)
    assert status.level == WARN
    for words in (
        "1 joint state ignored: 7 bytes are not a JointState",
        "1 goal refused",
        "time or the arm jumped; the arm was held at its position",
        "torque clipped at the effort limit: ",
    ):
        assert words in status.message
    assert "trajectory refused" in values(status)["goal"]
    effort(node, 2 * MS, (0.0, 0.0))
    status = found(node)
    assert (status.level, status.message) == (OK, "ok")
    assert values(status)["jumps of time"] == values(status)["states passed over"] == "1"


def test_states_that_come_late_explain_errors(ros: Ros, capfd: pytest.CaptureFixture[str]) -> None:
    node = ros.add(ControllerNode, models.scene("two_link"))
    for stamp in (0, 1, 2, 45, 46, 136):
        effort(node, stamp * MS, (0.0, 0.0))
    node._lateness.end_second()
    assert found(node).message.startswith("joint states came up to 0.09 s apart")
    assert "apart" not in capfd.readouterr().err, "once is no reason to log it"
    for stamp in (456, 457):
        effort(node, stamp * MS, (0.0, 0.0))
    node._lateness.end_second()
    status = found(node)
    assert status.level == WARN
    assert status.message.startswith(
        "joint states came up to 0.32 s apart: the machine is too busy"
    )
    assert "tracking errors come from that" in capfd.readouterr().err


def test_silence_is_an_error(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
    node, clock = ros.add(ControllerNode, models.scene("two_link")), time.monotonic
    node.on_joint_states(state(0))
    monkeypatch.setattr(answer_log, "time", SimpleNamespace(monotonic=lambda: clock() + 1.1))
    status = found(node)
    assert (status.level, status.message) == (ERROR, "no joint state for 1.1 s")
    node.on_joint_states(state(MS))
    assert found(node).level == OK
