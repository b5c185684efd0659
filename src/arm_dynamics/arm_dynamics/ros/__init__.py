# SPDX-License-Identifier: Apache-2.0
"""ROS 2 nodes of the dynamics package, and what every node of the suite shares."""
