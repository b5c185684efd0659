# SPDX-License-Identifier: Apache-2.0
"""The standard services of simulators, each by a client; bad requests included."""

import importlib.util
from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
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


class Client:
    """Calls services of the sim."""

    def __init__(self, ros: Ros) -> None:
        self.ros = ros

    def __call__(self, name: str, **fields: Any) -> Any:
        """The response to a request."""
        from simulation_interfaces import srv

        kind = getattr(srv, name.title().replace("_", ""))
        return self.ros.call(kind, f"/sim/{name}", kind.Request(**fields))

    def enter(self, state: int) -> int:
        """The code that a change of state is answered with."""
        from simulation_interfaces.msg import SimulationState

        return self("set_simulation_state", state=SimulationState(state=state)).result.result

    @property
    def state(self) -> int:
        """The state of the simulation."""
        answer = self("get_simulation_state")
        assert answer.result.result == OK
        return answer.state.state

    def entities(self, **filters: Any) -> Any:
        """The response to a question for entities."""
        from simulation_interfaces.msg import EntityFilters

        return self("get_entities", filters=EntityFilters(**filters))


@pytest.fixture(scope="module")
def shared() -> Iterator[tuple[Ros, SimNode]]:
    """A Panda whose ticks are triggered by hand, for all tests."""
    ros = Ros()
    yield ros, by_hand(ros, "panda")
    ros.close()


@pytest.fixture
def client(shared: tuple[Ros, SimNode]) -> Client:
    """A client of it."""
    return Client(shared[0])


@pytest.fixture
def node(shared: tuple[Ros, SimNode], client: Client) -> SimNode:
    """The node, at its start and running."""
    client.enter(PLAYING)
    shared[1].engine.reset()
    return shared[1]


def test_may_be_turned_off(ros: Ros) -> None:
    assert not by_hand(ros, standard_services=False).standard.offered
    services = dict(ros.peer.get_service_names_and_types())
    assert "/sim/get_simulator_features" not in services


def test_features_are_those_of_what_is_offered(client: Client, node: SimNode) -> None:
    from simulation_interfaces.msg import SimulatorFeatures as Known

    features = client("get_simulator_features").features
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
    assert list(features.spawn_formats) == []


def test_pauses_plays_and_stops(client: Client, node: SimNode) -> None:
    node.tick()
    assert client.state == PLAYING
    assert client.enter(PAUSED) == OK
    node.tick()
    assert node.simulator.arm.step_count == 1
    assert client.state == PAUSED
    assert client.enter(STOPPED) == OK
    assert node.simulator.arm.step_count == 0
    assert client.state == STOPPED
    assert client.enter(PLAYING) == OK
    node.tick()
    assert node.simulator.arm.step_count == 1


@pytest.mark.parametrize(
    ("before", "target", "code"),
    [
        (PLAYING, PLAYING, ALREADY_THERE),
        (PAUSED, PAUSED, ALREADY_THERE),
        (STOPPED, STOPPED, ALREADY_THERE),
        (STOPPED, PAUSED, INCORRECT_TRANSITION),
        (PLAYING, QUITTING, UNSUPPORTED),
        (PAUSED, 200, UNSUPPORTED),
    ],
)
def test_changes_that_are_none_change_nothing(
    client: Client, node: SimNode, before: int, target: int, code: int
) -> None:
    node.tick()
    if before != PLAYING:
        assert client.enter(before) == OK
    count = node.simulator.arm.step_count
    assert client.enter(target) == code
    assert client.state == before
    assert node.simulator.arm.step_count == count


@pytest.mark.parametrize(
    ("scope", "time_back", "state_back"),
    [(0, True, True), (255, True, True), (1, True, False), (2, False, True)],
)
def test_resets_what_the_scope_names(
    client: Client, node: SimNode, scope: int, time_back: bool, state_back: bool
) -> None:
    start = motion(node)
    ticks(node, 20)
    fallen = motion(node)
    assert not np.array_equal(start, fallen)
    assert client("reset_simulation", scope=scope).result.result == OK
    assert node.simulator.arm.step_count == (0 if time_back else 20)
    np.testing.assert_array_equal(motion(node), start if state_back else fallen)


def test_time_goes_back_without_the_states_of_drives(ros: Ros) -> None:
    client, node = Client(ros), by_hand(ros, "flexible_arm")
    ticks(node, 20)
    before = node.simulator.state
    assert client("reset_simulation", scope=1).result.result == OK
    assert node.simulator.arm.step_count == 0
    assert before.z.any()
    np.testing.assert_array_equal(node.simulator.state.z, before.z)


def test_what_is_never_spawned_cannot_be_removed(client: Client, node: SimNode) -> None:
    ticks(node, 5)
    for scope in 4, 8:
        result = client("reset_simulation", scope=scope).result
        assert result.result == UNSUPPORTED
        assert f"scope {scope}; allowed:" in result.error_message
    assert node.simulator.arm.step_count == 5


def test_steps(client: Client, node: SimNode) -> None:
    assert client("step_simulation").result.result == OK  # one, by default
    assert client("step_simulation", steps=9).result.result == OK
    twin = models.simulator("panda")
    for _ in range(10):
        twin.step(np.zeros(7))
    np.testing.assert_array_equal(motion(node), [twin.state.q, twin.state.v])


def test_steps_out_of_range_are_refused(client: Client, node: SimNode) -> None:
    for steps in 0, 10_001, 2**64 - 1:
        result = client("step_simulation", steps=steps).result
        assert result.result == FAILED
        assert result.error_message == f"steps = {steps}; allowed: 1 to 10000"
    assert node.simulator.arm.step_count == 0


def test_the_robot_and_its_links_are_the_entities(client: Client, node: SimNode) -> None:
    answer = client.entities()
    assert answer.result.result == OK
    links = [f.name for f in node.simulator.model.whole.frames if f.type.name == "BODY"]
    assert sorted(answer.entities) == sorted(["panda", *(f"panda/{link}" for link in links)])


def test_filters_choose(client: Client, node: SimNode) -> None:
    from simulation_interfaces.msg import EntityCategory, TagsFilter

    robots = client.entities(categories=[EntityCategory(category=EntityCategory.CATEGORY_ROBOT)])
    assert list(robots.entities) == ["panda"]
    fingers = client.entities(filter="(left|right)finger$")
    assert sorted(fingers.entities) == ["panda/panda_leftfinger", "panda/panda_rightfinger"]
    assert list(client.entities(filter="^[[:alpha:]]+$").entities) == ["panda"]
    fixed = TagsFilter(tags=["link", "fixed"], filter_mode=TagsFilter.FILTER_MODE_ALL)
    assert list(client.entities(tags=fixed).entities) == ["panda/panda_link0"]
    either = TagsFilter(tags=["arm", "fixed"], filter_mode=TagsFilter.FILTER_MODE_ANY)
    assert list(client.entities(tags=either).entities) == ["panda", "panda/panda_link0"]
    both = client.entities(tags=either, filter="link0")
    assert list(both.entities) == ["panda/panda_link0"]


def test_bad_expressions_are_refused(client: Client, node: SimNode) -> None:
    for filter_, complaint in (
        ("(", "'(' is not a POSIX extended regular expression: "), ("a{1,255}", "intervals"),
        ("(a)\\1", "back references"), ("a" * 100_000, "allowed: 200 characters"),
    ):  # fmt: skip
        answer = client.entities(filter=filter_)
        assert answer.result.result == FAILED
        assert complaint in answer.result.error_message
        assert len(answer.result.error_message) < 300
        assert list(answer.entities) == []


def test_other_bad_filters_are_refused(client: Client, node: SimNode) -> None:
    from geometry_msgs.msg import Vector3
    from simulation_interfaces.msg import Bounds, TagsFilter

    sphere = Bounds(type=Bounds.TYPE_SPHERE, points=[Vector3(), Vector3(x=1.0)])
    assert client.entities(bounds=sphere).result.result == UNSUPPORTED
    box = client.entities(bounds=Bounds(type=Bounds.TYPE_BOX)).result
    assert box.result == UNSUPPORTED
    assert "bounds of type 1 with 0 points" in box.error_message
    modes = client.entities(tags=TagsFilter(tags=["arm"], filter_mode=2))
    assert modes.result.result == FAILED
    assert "filter_mode is 2" in modes.result.error_message


def test_entities_state_their_kind(client: Client, node: SimNode) -> None:
    robot = client("get_entity_info", entity="panda")
    assert robot.result.result == OK
    assert (robot.info.category.category, list(robot.info.tags)) == (1, ["arm"])
    hand = client("get_entity_info", entity="panda/panda_hand").info
    assert hand.description == "a link, moved by panda_joint7"
    assert list(hand.tags) == ["link", "moving"]


def test_an_unknown_entity_is_not_found(client: Client, node: SimNode) -> None:
    for service in "get_entity_info", "get_entity_state":
        result = client(service, entity="teapot\n" * 1000).result
        assert result.result == NOT_FOUND
        assert result.error_message.startswith("no entity 'teapot\\nteapot")
        assert len(result.error_message) < 300


def test_entities_are_where_pinocchio_sees_them(client: Client, node: SimNode) -> None:
    ticks(node, 50)
    state = client("get_entity_state", entity="panda/panda_hand").state
    model = node.simulator.model.pin
    data, (q, v) = model.createData(), motion(node)
    pin.forwardKinematics(model, data, q, v)
    frame = model.getFrameId("panda_hand")
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


def test_states_of_many_are_those_of_each(client: Client, node: SimNode) -> None:
    from simulation_interfaces.msg import EntityFilters

    ticks(node, 10)
    answer = client("get_entities_states", filters=EntityFilters(filter="link[0-3]"))
    assert answer.result.result == OK
    assert list(answer.entities) == [f"panda/panda_link{i}" for i in range(4)]
    each = [client("get_entity_state", entity=name).state for name in answer.entities]
    assert list(answer.states) == each
    none = client("get_entities_states", filters=EntityFilters(filter="teapot"))
    assert (none.result.result, list(none.entities), list(none.states)) == (OK, [], [])


def test_the_world_is_the_scene(ros: Ros) -> None:
    path = str(models.SCENES / "two_link.yaml")
    ros.add(SimNode, scene=path, realtime=False)
    answer = Client(ros)("get_current_world")
    assert answer.result.result == OK
    assert answer.world.world_resource.uri == path
    assert answer.world.name


class Stepper:
    """A client of the action."""

    def __init__(self, ros: Ros) -> None:
        from rclpy.action import ActionClient
        from simulation_interfaces.action import SimulateSteps

        self.ros, self.kind = ros, SimulateSteps
        self.client = ActionClient(ros.peer, SimulateSteps, "/sim/simulate_steps")
        ros.spin_until(self.client.server_is_ready)
        self.heard: list[Any] = []

    def send(self, steps: int) -> Any:
        """A goal that was accepted."""
        goal = self.kind.Goal(steps=steps)
        sent = self.client.send_goal_async(goal, lambda told: self.heard.append(told.feedback))
        self.ros.spin_until(sent.done)
        assert sent.result().accepted
        return sent.result()

    def outcome(self, goal: Any) -> tuple[int, int, str]:
        """Status of a goal, its code and its message, once it is over."""
        result = goal.get_result_async()
        self.ros.spin_until(result.done)
        end = result.result().result.result
        return result.result().status, end.result, end.error_message


SUCCEEDED, CANCELED, ABORTED = 4, 5, 6  # action_msgs/GoalStatus


@pytest.fixture
def stepper(shared: tuple[Ros, SimNode]) -> Any:
    """A client that requests steps."""
    made = []

    def make(ros: Ros = shared[0]) -> Stepper:
        made.append(Stepper(ros))
        return made[0]

    yield make
    for one in made:
        one.client.destroy()


def test_the_action_makes_steps_and_reports_how_many(stepper: Any, node: SimNode) -> None:
    mine, steps = stepper(), 1234
    assert mine.outcome(mine.send(steps)) == (SUCCEEDED, OK, "")
    assert node.simulator.arm.step_count == steps
    mine.ros.spin_until(lambda: mine.heard and not mine.heard[-1].remaining_steps)
    completed = [told.completed_steps for told in mine.heard]
    assert completed == sorted(completed)
    assert {told.completed_steps + told.remaining_steps for told in mine.heard} == {steps}


def test_the_action_ends_when_it_is_cancelled(stepper: Any, node: SimNode) -> None:
    mine = stepper()
    goal = mine.send(2**62)
    mine.ros.spin_until(lambda: mine.heard)
    mine.ros.spin_until(goal.cancel_goal_async().done)
    status, code, said = mine.outcome(goal)
    assert (status, code) == (CANCELED, OK)
    assert said == f"cancelled after {node.simulator.arm.step_count} of {2**62} steps"
    assert mine.outcome(mine.send(3))[0] == SUCCEEDED


def test_one_goal_at_a_time_and_of_a_step_at_least(stepper: Any, node: SimNode) -> None:
    mine = stepper()
    assert mine.outcome(mine.send(0)) == (ABORTED, FAILED, "steps = 0; allowed: 1 or more")
    first = mine.send(2**62)
    status, code, said = mine.outcome(mine.send(5))
    assert (status, code) == (ABORTED, INCORRECT_STATE)
    assert "another goal is under way" in said
    mine.ros.spin_until(first.cancel_goal_async().done)
    assert mine.outcome(first)[0] == CANCELED


def test_the_action_needs_a_pause(ros: Ros, stepper: Any) -> None:
    node, client = ros.add(SimNode, models.scene("two_link")), Client(ros)
    mine = stepper(ros)
    status, code, said = mine.outcome(mine.send(5))
    assert (status, code) == (ABORTED, FAILED)
    assert "allowed only while it is paused" in said
    assert client.enter(PAUSED) == OK
    goal = mine.send(2**62)
    ros.spin_until(lambda: mine.heard)
    node.engine.queue.run(lambda: node.engine.pause(False))  # by someone else, on the way
    status, code, said = mine.outcome(goal)
    assert (status, code) == (ABORTED, FAILED)
    assert "allowed only while it is paused" in said


def test_divergence_ends_the_action(stepper: Any, node: SimNode) -> None:
    assert node.set_parameters([Parameter("stale_policy", value="hold")])[0].successful
    node.simulator.set_state(v=np.full(7, 1e160))
    mine = stepper()
    status, code, said = mine.outcome(mine.send(50))
    assert (status, code) == (ABORTED, FAILED)
    assert "that state is kept" in said
