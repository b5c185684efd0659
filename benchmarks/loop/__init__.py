# SPDX-License-Identifier: Apache-2.0
"""The loop over ROS, next to what rclpy and a bare thread do in the same run."""
