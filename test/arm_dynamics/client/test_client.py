# SPDX-License-Identifier: Apache-2.0
"""The client: numpy in and out, and one clear error when something is wrong."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arm_msgs.srv import ModelInfo
from forging import running
from harness import Ros
from rclpy.node import Node

import models
from arm_dynamics import InvalidInput
from arm_dynamics.client import ArmClient
from arm_dynamics.exceptions import Refused
from arm_dynamics.ros.common.caller import Caller, PolledClient
from arm_dynamics.ros.interfaces import (
    MAX_POINTS,
    MAX_TERMS_POINTS,
    MODEL_INFO,
    RESET,
    STEP,
    Service,
)
from tolerances import ALGEBRA

pytestmark = pytest.mark.ros

SCENE = str(models.SCENES / "two_link.yaml")
JOINTS = ["elbow", "shoulder"]


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory, forge: Path) -> Iterator[ArmClient]:
    """A client of two nodes in separate processes, in a separate domain."""
    logs = tmp_path_factory.mktemp("log")
    with running(forge, logs, ("dynamics", SCENE), ("sim", SCENE)) as domain:
        with ArmClient(timeout=60.0, domain=domain) as client:
            yield client


def test_terms_and_task_space_have_their_shapes(arm: ArmClient, rng: np.random.Generator) -> None:
    dynamics = models.dynamics("two_link")
    q, v = rng.normal(size=(2, 4, 2))
    assert arm.model_info().joint_names == dynamics.joint_names
    np.testing.assert_allclose(arm.forward_dynamics(q, v), dynamics.forward(q, v, 0.0 * v))
    assert arm.dynamics_terms(q[0], v[0]).mass_matrix.shape == (2, 2)
    seen = arm.task_space("tip", q, v, axes=("x", "z"), direction=(1.0, 0.0))
    assert seen["inertia"].shape == (4, 2, 2) and seen["effective_mass"].shape == (4,)
    assert seen["axes"] == ("x", "z")
    assert "effective_mass" not in arm.task_space("tip", q[0])


def test_the_largest_batch_of_terms_in_another_order_of_joints(
    arm: ArmClient, rng: np.random.Generator
) -> None:
    dynamics = models.dynamics("two_link")
    q, v = rng.normal(size=(2, MAX_TERMS_POINTS, 2))
    terms = arm.dynamics_terms(q, v, joint_names=JOINTS)
    for k in rng.integers(MAX_TERMS_POINTS, size=20):
        mine, speed = q[k, ::-1], v[k, ::-1]
        kinetic, potential = dynamics.energy(mine, speed)
        for made, expected in (
            (terms.mass_matrix, dynamics.mass_matrix(mine)[::-1, ::-1]),
            (terms.coriolis_matrix, dynamics.coriolis_matrix(mine, speed)[::-1, ::-1]),
            (terms.gravity, dynamics.gravity(mine)[::-1]),
            (terms.friction, dynamics.friction(speed)[::-1]),
            (terms.spring, dynamics.spring(mine, speed)[::-1]),
            (terms.kinetic_energy, kinetic),
            (terms.potential_energy, potential),
        ):
            np.testing.assert_allclose(made[k], expected, rtol=ALGEBRA, atol=ALGEBRA)


def test_bad_input_gets_one_clear_error_and_the_node_goes_on(arm: ArmClient) -> None:
    ask = arm.inverse_dynamics
    for wrong, error, said in (
        (lambda: ask([0.0, np.nan]), Refused, "'elbow' at point 0 is nan"),
        (lambda: ask([[[0.0, 0.0]]]), InvalidInput, r"shape \(1, 1, 2\)"),
        (lambda: ask("here"), InvalidInput, "real numbers are expected"),
        (lambda: ask([0.0] * 2, terms=256), InvalidInput, "terms = 256"),
        (lambda: ask(np.zeros((MAX_POINTS + 1, 2))), Refused, "up to"),
        (lambda: arm.step(-1), InvalidInput, "steps"),
        (lambda: arm.set_payload(1.0, com=(0.0, 0.0)), InvalidInput, "com has 2 numbers"),
    ):
        with pytest.raises(error, match=said):
            wrong()
        assert ask([0.0, 0.0]).shape == (2,)


def test_commands_to_the_simulation(arm: ArmClient) -> None:
    arm.pause()
    arm.reset()
    arm.set_joint_state([1.0], joint_names=["elbow"])
    assert arm.step(5) == pytest.approx(0.005)
    arm.reset_counters()
    with pytest.raises(Refused, match="'payload' is not tunable"):
        arm.set_payload(1.0)
    with pytest.raises(Refused, match="'friction' is not tunable"):
        arm.set_friction([0.1, 0.1])
    arm.resume()
    with pytest.raises(Refused, match="running"):
        arm.step()


def test_only_what_may_happen_twice_is_asked_again(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: dict[str, bool] = {}

    def ask(_: Caller, node: str, service: Service, request: Any, repeatable: bool) -> Any:
        asked[service.name] = repeatable
        return service.type.Response(success=True)

    monkeypatch.setattr(Caller, "ask", ask)
    with ArmClient(domain=ros.domain) as arm:
        arm.step(3)
        arm.reset()
    assert asked == {STEP.name: False, RESET.name: True}


def test_an_answer_to_a_question_that_was_interrupted_is_passed_over(ros: Ros) -> None:
    answered: list[float] = []

    def answer(_: object, response: ModelInfo.Response) -> ModelInfo.Response:
        response.total_mass = float(len(answered))
        answered.append(response.total_mass)
        return response

    ros.peer.create_service(ModelInfo, "dynamics/model_info", answer)
    asker = Node("asker", context=ros.context)  # which nobody spins
    client = PolledClient(asker, MODEL_INFO, "/dynamics/model_info")
    ros.spin_until(client.is_ready)
    client.send(ModelInfo.Request())
    present = client.send(ModelInfo.Request())
    ros.spin_until(lambda: len(answered) == 2)
    assert client.receive({present}, timeout=20.0).total_mass == 1.0
    asker.destroy_node()
