# SPDX-License-Identifier: Apache-2.0
"""Parameters of the sim node."""

from dataclasses import dataclass

from arm_dynamics import InvalidInput
from arm_dynamics.ros.common.params import SCENE, parameter
from arm_dynamics.ros.common.robot_source import DescriptionParams
from arm_dynamics.ros.common.threads.privileges import ThreadParams
from arm_sim.ros.commands.latest import BRAKE, POLICIES
from arm_sim.ros.timing.realtime_loop import CATCH_UP, OVERRUN
from arm_sim.ros.timing.stamps import AUTO, CHOICES, ROS, SIM
from arm_sim.simulation.simulator import Simulator

LOCKSTEP, CLOCK, HAND = "lockstep", "clock", "hand"
# Parameters that act only if ticks are triggered by one of these
_ONLY_WITH = {
    "realtime_factor": (CLOCK,), "overrun": (CLOCK,),
    "lockstep_retry": (LOCKSTEP,), "lockstep_timeout": (LOCKSTEP,),
    "priority": (CLOCK, LOCKSTEP), "cpus": (CLOCK, LOCKSTEP), "lock_memory": (CLOCK, LOCKSTEP),
}  # fmt: skip


@dataclass(frozen=True)
class SimParams(ThreadParams, DescriptionParams):
    """Parameters of the sim node."""

    scene: str = parameter("", f"{SCENE}; the simulated scene")
    integrator: str = parameter("", "Integration method; empty: that of the scene")
    dt: float = parameter(
        0.0, "Length of a time step [s]; 0: that of the scene", low=0.0, high=1.0
    )
    tolerance: float = parameter(
        0.0, "Error tolerance inside a time step; 0: that of the scene", low=0.0, high=1.0
    )
    realtime: bool = parameter(True, "Run in real time; false: only when tick() is called")
    realtime_factor: float = parameter(
        1.0, "Simulated time per real time; 0: as fast as possible", low=0.0, high=1000.0
    )
    overrun: str = parameter(
        CATCH_UP, "After a cycle that is late by more than a cycle: catch_up makes up for it, "
        "skip leaves out cycles whose time has passed, slow_down lets simulated time fall behind",
        choices=OVERRUN,
    )  # fmt: skip
    lockstep: bool = parameter(
        False, "Tick when a command has answered the current state, instead of in real time"
    )
    lockstep_retry: float = parameter(
        0.02, "Time after which an unanswered state is published again [s]", low=0.001, high=10.0
    )
    lockstep_timeout: float = parameter(
        1.0, "Time after which a silent partner is reported gone [s]", low=0.01, high=1e4
    )
    standard_services: bool = parameter(
        True, "Offer services and the action of simulation_interfaces where that is installed"
    )
    paused: bool = parameter(False, "Start paused")
    wait_for_command: bool = parameter(
        False, "Hold simulated time until the first command, also after a reset"
    )
    publish_every: int = parameter(
        1, "Number of time steps between joint states", low=1, high=100_000
    )
    time: str = parameter(
        AUTO, "Stamps: sim (simulated time), ros (the node's clock), or auto: ros where the "
        "simulation goes at the clock's pace and does not publish one", choices=CHOICES,
    )  # fmt: skip
    publish_description: bool = parameter(
        True, "Publish the URDF on robot_description, unless it came from there"
    )
    publish_all_joints: bool = parameter(
        False, "Include locked and mimic joints in joint_states, not only in ~/all_joint_states"
    )
    publish_tf: bool = parameter(
        True, "Publish /tf and /tf_static, while no robot_state_publisher does; needs tf2_msgs"
    )
    frame_prefix: str = parameter("", "Prefix of every frame name on /tf, such as left/")
    frame_id: str = parameter("", "frame_id of the joint states")
    display_rate: float = parameter(
        50.0, "Messages per second on /tf and ~/all_joint_states; 0: none", low=0.0, high=1000.0
    )
    publish_clock: bool = parameter(False, "Publish simulated time on /clock")
    record: str = parameter(
        "", "File (.mcap) or folder of a bag to record every time step to; {time} in its name "
        "stands for the time of the start; empty: none",
    )  # fmt: skip
    energy_period: float = parameter(
        0.1, "Time between messages on ~/energy [s]", low=0.001, high=10.0
    )
    wrench_timeout: float = parameter(
        0.1, "Simulated time that a wrench acts [s]", low=0.0, high=3600.0
    )
    wrench_reference: str = parameter(
        "local", "Axes of wrenches: local (of the frame that is pushed) or local_world_aligned "
        "(of the world)", choices=("local", "local_world_aligned"),
    )  # fmt: skip
    command_timeout: float = parameter(
        0.1, "Simulated time after which a command is old [s]; 0: never; while the loop catches "
        "up, only real time counts",
        low=0.0, high=3600.0, read_only=False,
    )  # fmt: skip
    stale_policy: str = parameter(
        BRAKE, "What acts without a command or with an old one: brake stops the arm and its "
        "brakes hold it; servo stops it and the servos hold it; zero torque; hold of the last "
        "torque; or gravity, the torque that compensates gravity and springs",
        choices=POLICIES, read_only=False,
    )  # fmt: skip

    def __post_init__(self) -> None:
        """Refuse invalid processor lists, and stamps that contradict the source of time."""
        super().__post_init__()
        owner = "lockstep" if self.lockstep else "publish_clock" if self.publish_clock else ""
        if owner and self.time == ROS:
            raise InvalidInput(
                f"parameter 'time' is 'ros' with {owner}, where simulated time is the time; "
                "allowed: sim or auto"
            )

    @property
    def unused(self) -> tuple[str, ...]:
        """Names of the parameters that were set and have no effect on what triggers ticks."""
        source, initial = self.tick_source, SimParams()
        return tuple(
            name
            for name, sources in _ONLY_WITH.items()
            if source not in sources and getattr(self, name) != getattr(initial, name)
        )

    @property
    def stamps(self) -> str:
        """The kind of stamps in use: ``sim`` or ``ros``."""
        if self.time != AUTO:
            return self.time
        follows = self.tick_source == CLOCK and self.realtime_factor == 1.0
        return ROS if follows and not self.publish_clock else SIM

    @property
    def tick_source(self) -> str:
        """What triggers ticks: ``lockstep``, ``clock``, or a caller by ``hand``."""
        return LOCKSTEP if self.lockstep else CLOCK if self.realtime else HAND


def greeting(simulator: Simulator, params: SimParams) -> str:
    """Start-up message: the simulated robot, method, pace and source."""
    model, choice = simulator.model, simulator.choice
    at = ", ".join(f"{name} {q:.4g}" for name, q in zip(model.joint_names, model.q0, strict=True))
    factor = params.realtime_factor
    by_clock = {0.0: "as fast as it goes", 1.0: "in real time"}
    pace = {
        LOCKSTEP: "in lockstep", HAND: "by hand",
        CLOCK: by_clock.get(factor, f"{factor:g} times as fast as the clock"),
    }[params.tick_source]  # fmt: skip
    paused = ", paused at first" if params.paused else ""
    return (
        f"simulates {model.n} joints of '{model.pin.name}' by {choice.method.name}, "
        f"time step {1e3 * choice.dt:g} ms, {pace}{paused}; from {at}; to see it: ./arm watch"
    )
