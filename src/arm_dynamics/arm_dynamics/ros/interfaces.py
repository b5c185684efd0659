# SPDX-License-Identifier: Apache-2.0
"""Names, types and quality of service of all topics and services, in one place.

All names are relative, so namespaces and remapping work. Publishers are reliable, and subscribers
of control topics receive the newest message by best effort, which is compatible with every
partner.
"""

from typing import Any, NamedTuple

from arm_msgs import msg, srv
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

try:
    from control_msgs.action import FollowJointTrajectory
except ImportError:  # a ROS distribution without ros2_control
    FollowJointTrajectory = None

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
# With several sources, keep all messages within a tick, so that one does not displace another.
SOURCES = QoSProfile(depth=16, reliability=ReliabilityPolicy.BEST_EFFORT)
EVERY = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)

MAX_POINTS = 100_000  # per service call
MAX_TERMS_POINTS = 10_000  # where the response contains matrices
MAX_POSES = 1000  # for inverse kinematics
MAX_GOAL_POINTS = 10_000  # per trajectory or path


class Topic(NamedTuple):
    """A topic: its name, its type, and how it is published and subscribed."""

    name: str
    type: Any
    publish: QoSProfile = EVERY
    subscribe: QoSProfile = EVERY


class Service(NamedTuple):
    """A service: its name and its type."""

    name: str
    type: Any


class Action(NamedTuple):
    """An action: its name and its type, None where no package that defines it is installed."""

    name: str
    type: Any


JOINT_STATES = Topic("joint_states", JointState, subscribe=NEWEST)
JOINT_COMMANDS = Topic("joint_commands", JointState, subscribe=SOURCES)
JOINT_TRAJECTORY = Topic("~/joint_trajectory", JointTrajectory)
CARTESIAN_GOAL = Topic("~/cartesian_goal", PoseStamped)
CARTESIAN_PATH = Topic("~/cartesian_path", Path)
CONTROLLER_STATE = Topic("~/state", msg.TrackingState)
ROBOT_DESCRIPTION = Topic("robot_description", String, publish=LATCHED, subscribe=LATCHED)
DIAGNOSTICS = Topic("/diagnostics", DiagnosticArray)

FOLLOW_JOINT_TRAJECTORY = Action("~/follow_joint_trajectory", FollowJointTrajectory)

INVERSE_DYNAMICS = Service("~/inverse_dynamics", srv.InverseDynamics)
FORWARD_DYNAMICS = Service("~/forward_dynamics", srv.ForwardDynamics)
DYNAMICS_TERMS = Service("~/dynamics_terms", srv.DynamicsTerms)
MODEL_INFO = Service("~/model_info", srv.ModelInfo)
CONSTRAINED_DYNAMICS = Service("~/constrained_dynamics", srv.ConstrainedDynamics)
TASK_SPACE = Service("~/task_space", srv.TaskSpace)
INVERSE_KINEMATICS = Service("~/inverse_kinematics", srv.InverseKinematics)

# Services of the sim node, defined here because the client calls them too.
RESET = Service("~/reset", Trigger)
PAUSE = Service("~/pause", SetBool)
STEP = Service("~/step", srv.Step)
SET_JOINT_STATE = Service("~/set_joint_state", srv.SetJointState)
SET_PAYLOAD = Service("~/set_payload", srv.SetPayload)
SET_FRICTION = Service("~/set_friction", srv.SetFriction)
RESET_COUNTERS = Service("~/reset_counters", Trigger)
