# SPDX-License-Identifier: Apache-2.0
"""The standard services of simulators, and their action; bad requests included."""

import importlib.util
from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from goal_client import Client
from harness import Ros
from rclpy.parameter import Parameter
from sim_by_hand import by_hand, motion, ticks

import models
from arm_dynamics.ros.common.convert import to_nanoseconds
from arm_sim.ros import SimNode
from tolerances import ALGEBRA, assert_close

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(
        importlib.util.find_spec("simulation_interfaces") is None,
        reason="simulation_interfaces is not built",
    ),
]

# As in SimulationState.msg, Result.msg and SetSimulationState.srv of simulation_interfaces.
STOPPED, PLAYING, PAUSED, QUITTING = range(4)
UNSUPPORTED, OK, NOT_FOUND, INCORRECT_STATE, FAILED = range(5)
ALREADY_THERE, INCORRECT_TRANSITION = 101, 103
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6  # action_msgs/GoalStatus


def ask(node: SimNode, name: str, **fields: Any) -> Any:
    """The response of a service of the sim."""
    (service,) = (each for each in node.services if each.srv_name.endswith(f"/{name}"))
    return service.callback(service.srv_type.Request(**fields), service.srv_type.Response())


def enter(node: SimNode, state: int) -> int:
    """The code that a change of state is answered with."""
    from simulation_interfaces.msg import SimulationState

    return ask(node, "set_simulation_state", state=SimulationState(state=state)).result.result


class Stepper(Client):
    """A client of the action."""

    def __init__(self, ros: Ros) -> None:
        from simulation_interfaces.action import SimulateSteps

        super().__init__(ros, "/sim/simulate_steps", SimulateSteps)
        self._kind = SimulateSteps

    def steps(self, count: int) -> Any:
        """A goal, which is accepted."""
        handle = self.send(self._kind.Goal(steps=count))
        assert handle.accepted
        return handle

    def outcome(self, goal: Any) -> tuple[int, int, str]:
        """Status of a goal, its code and its message, once it is over."""
        status, answer = self.result(goal)
        return status, answer.result.result, answer.result.error_message


@pytest.fixture(scope="module")
def shared() -> Iterator[tuple[Ros, SimNode]]:
    """A Panda whose ticks are triggered by hand, for all tests."""
    ros = Ros()
    yield ros, by_hand(ros, "panda")
    ros.close()


@pytest.fixture
def node(shared: tuple[Ros, SimNode]) -> SimNode:
    """The node, at its start and running."""
    shared[1].engine.pause(False)
    shared[1].engine.reset()
    return shared[1]


@pytest.fixture
def stepper(shared: tuple[Ros, SimNode], node: SimNode) -> Iterator[Stepper]:
    """A client that has it make steps."""
    made = Stepper(shared[0])
    yield made
    made.close()


def test_may_be_turned_off(ros: Ros) -> None:
    assert not by_hand(ros, standard_services=False).standard.offered
    services = dict(ros.peer.get_service_names_and_types())
    assert "/sim/get_simulator_features" not in services


def test_features_are_those_of_what_is_offered(shared: tuple[Ros, SimNode]) -> None:
    from simulation_interfaces.msg import SimulatorFeatures as Known
    from simulation_interfaces.srv import GetSimulatorFeatures as Get

    features = shared[0].call(Get, "/sim/get_simulator_features", Get.Request()).features
    assert sorted(features.features) == sorted(
        [
            Known.ENTITY_TAGS, Known.ENTITY_CATEGORIES, Known.ENTITY_STATE_GETTING,
            Known.ENTITY_INFO_GETTING, Known.SIMULATION_RESET, Known.SIMULATION_RESET_TIME,
            Known.SIMULATION_RESET_STATE, Known.SIMULATION_STATE_GETTING,
            Known.SIMULATION_STATE_SETTING, Known.SIMULATION_STATE_PAUSE,
            Known.STEP_SIMULATION_SINGLE, Known.STEP_SIMULATION_MULTIPLE,
            Known.STEP_SIMULATION_ACTION, Known.WORLD_INFO_GETTING,
        ]
    )  # fmt: skip


def test_pauses_plays_and_stops(node: SimNode) -> None:
    """Each change of state, and that those which are none change nothing."""
    assert ask(node, "get_simulation_state").state.state == PLAYING
    for target, code, state, count in (
        (PLAYING, ALREADY_THERE, PLAYING, 1), (QUITTING, UNSUPPORTED, PLAYING, 2),
        (PAUSED, OK, PAUSED, 2), (PAUSED, ALREADY_THERE, PAUSED, 2), (200, UNSUPPORTED, PAUSED, 2),
        (STOPPED, OK, STOPPED, 0), (PAUSED, INCORRECT_TRANSITION, STOPPED, 0),
        (STOPPED, ALREADY_THERE, STOPPED, 0), (PLAYING, OK, PLAYING, 1),
    ):  # fmt: skip
        assert enter(node, target) == code
        node.tick()
        answer = ask(node, "get_simulation_state")
        assert (answer.state.state, node.simulator.arm.step_count) == (state, count)


@pytest.mark.parametrize(
    ("scope", "time_back", "state_back"),
    [(0, True, True), (255, True, True), (1, True, False), (2, False, True)],
)
def test_resets_what_the_scope_names(
    node: SimNode, scope: int, time_back: bool, state_back: bool
) -> None:
    start = motion(node)
    ticks(node, 20)
    fallen = motion(node)
    assert not np.array_equal(start, fallen)
    for spawned in 4, 8:  # nothing is, ever
        result = ask(node, "reset_simulation", scope=spawned).result
        assert result.result == UNSUPPORTED
        assert f"scope {spawned}; allowed:" in result.error_message
    assert ask(node, "reset_simulation", scope=scope).result.result == OK
    assert node.simulator.arm.step_count == (0 if time_back else 20)
    np.testing.assert_array_equal(motion(node), start if state_back else fallen)


def test_time_goes_back_without_the_states_of_drives(ros: Ros) -> None:
    node = by_hand(ros, "flexible_arm")
    ticks(node, 20)
    before = node.simulator.state
    assert ask(node, "reset_simulation", scope=1).result.result == OK
    assert node.simulator.arm.step_count == 0
    assert before.z.any()
    np.testing.assert_array_equal(node.simulator.state.z, before.z)


def test_steps(node: SimNode) -> None:
    for steps in 0, 10_001, 2**64 - 1:
        result = ask(node, "step_simulation", steps=steps).result
        assert result.result == FAILED
        assert result.error_message == f"steps = {steps}; allowed: 1 to 10000"
    assert ask(node, "step_simulation").result.result == OK  # one, by default
    assert ask(node, "step_simulation", steps=9).result.result == OK
    twin = models.simulator("panda")
    for _ in range(10):
        twin.step(np.zeros(7))
    np.testing.assert_array_equal(motion(node), [twin.state.q, twin.state.v])


def test_the_robot_and_its_links_are_the_entities_of_which_filters_choose(node: SimNode) -> None:
    from simulation_interfaces.msg import EntityCategory, EntityFilters, TagsFilter

    links = [f.name for f in node.simulator.model.whole.frames if f.type.name == "BODY"]
    category = EntityCategory(category=EntityCategory.CATEGORY_ROBOT)
    fixed = TagsFilter(tags=["link", "fixed"], filter_mode=TagsFilter.FILTER_MODE_ALL)
    either = TagsFilter(tags=["arm", "fixed"], filter_mode=TagsFilter.FILTER_MODE_ANY)
    for filters, found in (
        ({}, ["panda", *(f"panda/{link}" for link in links)]),
        ({"categories": [category]}, ["panda"]),
        ({"filter": "(left|right)finger$"}, ["panda/panda_leftfinger", "panda/panda_rightfinger"]),
        ({"filter": "^[[:alpha:]]+$"}, ["panda"]),
        ({"tags": fixed}, ["panda/panda_link0"]),
        ({"tags": either}, ["panda", "panda/panda_link0"]),
        ({"tags": either, "filter": "link0"}, ["panda/panda_link0"]),
    ):
        answer = ask(node, "get_entities", filters=EntityFilters(**filters))
        assert answer.result.result == OK
        assert sorted(answer.entities) == sorted(found)


def test_bad_filters_are_refused(node: SimNode) -> None:
    from geometry_msgs.msg import Vector3
    from simulation_interfaces.msg import Bounds, EntityFilters, TagsFilter

    sphere = Bounds(type=Bounds.TYPE_SPHERE, points=[Vector3(), Vector3(x=1.0)])
    wrong_mode = TagsFilter(tags=["arm"], filter_mode=2)
    for filters, code, complaint in (
        ({"filter": "("}, FAILED, "'(' is not a POSIX extended regular expression: "),
        ({"filter": "a{1,255}"}, FAILED, "intervals"),
        ({"filter": "(a)\\1"}, FAILED, "back references"),
        ({"filter": "a" * 100_000}, FAILED, "allowed: 200 characters"),
        ({"bounds": sphere}, UNSUPPORTED, ""),
        ({"bounds": Bounds(type=Bounds.TYPE_BOX)}, UNSUPPORTED, "bounds of type 1 with 0 points"),
        ({"tags": wrong_mode}, FAILED, "filter_mode is 2"),
    ):
        answer = ask(node, "get_entities", filters=EntityFilters(**filters))
        assert answer.result.result == code
        assert complaint in answer.result.error_message
        assert len(answer.result.error_message) < 300
        assert list(answer.entities) == []


def test_entities_state_their_kind_and_unknown_ones_are_not_found(node: SimNode) -> None:
    robot = ask(node, "get_entity_info", entity="panda")
    assert robot.result.result == OK
    assert (robot.info.category.category, list(robot.info.tags)) == (1, ["arm"])
    hand = ask(node, "get_entity_info", entity="panda/panda_hand").info
    assert hand.description == "a link, moved by panda_joint7"
    assert list(hand.tags) == ["link", "moving"]
    for service in "get_entity_info", "get_entity_state":
        result = ask(node, service, entity="teapot\n" * 1000).result
        assert result.result == NOT_FOUND
        assert result.error_message.startswith("no entity 'teapot\\nteapot")
        assert len(result.error_message) < 300


def test_entities_are_where_pinocchio_sees_them(node: SimNode) -> None:
    from simulation_interfaces.msg import EntityFilters

    ticks(node, 50)
    answer = ask(node, "get_entities_states", filters=EntityFilters(filter="link[0-3]|hand$"))
    assert answer.result.result == OK
    names = [*(f"panda_link{i}" for i in range(4)), "panda_hand"]
    assert list(answer.entities) == [f"panda/{name}" for name in names]
    model = node.simulator.model.pin
    data, (q, v) = model.createData(), motion(node)
    pin.forwardKinematics(model, data, q, v)
    for name, state in zip(names, answer.states, strict=True):
        assert ask(node, "get_entity_state", entity=f"panda/{name}").state == state
        frame = model.getFrameId(name)
        place = pin.updateFramePlacement(model, data, frame)
        moving = pin.getFrameVelocity(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        at, turn = state.pose.position, state.pose.orientation
        assert_close([at.x, at.y, at.z], place.translation, ALGEBRA)
        rotation = pin.Quaternion(turn.w, turn.x, turn.y, turn.z).toRotationMatrix()
        assert_close(rotation, place.rotation, ALGEBRA)
        linear, angular = state.twist.linear, state.twist.angular
        assert_close([linear.x, linear.y, linear.z], moving.linear, ALGEBRA)
        assert_close([angular.x, angular.y, angular.z], moving.angular, ALGEBRA)
        assert state.header.frame_id == "world"
        assert to_nanoseconds(state.header.stamp) == 50_000_000


def test_the_world_is_the_scene(ros: Ros) -> None:
    path = str(models.SCENES / "two_link.yaml")
    node = ros.add(SimNode, scene=path, realtime=False)
    answer = ask(node, "get_current_world")
    assert answer.result.result == OK
    assert answer.world.world_resource.uri == path
    assert answer.world.name


def test_the_action_makes_steps_and_reports_how_many(
    shared: tuple[Ros, SimNode], stepper: Stepper, node: SimNode
) -> None:
    steps = 1234
    assert stepper.outcome(stepper.steps(steps)) == (SUCCEEDED, OK, "")
    assert node.simulator.arm.step_count == steps
    ros = shared[0]
    ros.spin_until(lambda: stepper.feedback and not stepper.feedback[-1].remaining_steps)
    completed = [told.completed_steps for told in stepper.feedback]
    assert completed == sorted(completed)
    assert {told.completed_steps + told.remaining_steps for told in stepper.feedback} == {steps}


def test_one_goal_at_a_time_of_a_step_at_least_which_may_be_cancelled(
    stepper: Stepper, node: SimNode
) -> None:
    assert stepper.outcome(stepper.steps(0)) == (ABORTED, FAILED, "steps = 0; allowed: 1 or more")
    first = stepper.steps(2**62)
    status, code, said = stepper.outcome(stepper.steps(5))
    assert (status, code) == (ABORTED, INCORRECT_STATE)
    assert "another goal is under way" in said
    assert stepper.cancel(first) == 1
    status, code, said = stepper.outcome(first)
    assert (status, code) == (CANCELED, OK)
    assert said == f"cancelled after {node.simulator.arm.step_count} of {2**62} steps"
    assert stepper.outcome(stepper.steps(3))[0] == SUCCEEDED


def test_the_action_needs_a_pause(ros: Ros) -> None:
    node, stepper = ros.add(SimNode, models.scene("two_link")), Stepper(ros)
    status, code, said = stepper.outcome(stepper.steps(5))
    assert (status, code) == (ABORTED, FAILED)
    assert "allowed only while it is paused" in said
    assert enter(node, PAUSED) == OK
    goal = stepper.steps(2**62)
    ros.spin_until(lambda: stepper.feedback)
    node.engine.queue.run(lambda: node.engine.pause(False))  # by someone else, on the way
    status, code, said = stepper.outcome(goal)
    assert (status, code) == (ABORTED, FAILED)
    assert "allowed only while it is paused" in said
    stepper.close()


def test_divergence_ends_the_action(stepper: Stepper, node: SimNode) -> None:
    assert node.set_parameters([Parameter("stale_policy", value="hold")])[0].successful
    node.simulator.set_state(v=np.full(7, 1e160))
    status, code, said = stepper.outcome(stepper.steps(50))
    assert (status, code) == (ABORTED, FAILED)
    assert "that state is kept" in said
