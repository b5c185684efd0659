# SPDX-License-Identifier: Apache-2.0
"""The tests in this folder start ROS nodes."""

from ros_fixtures import arm, ros, ros_environment, transports  # noqa: F401
