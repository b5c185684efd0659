# SPDX-License-Identifier: Apache-2.0
"""The loop over ROS, next to what rclpy and a bare thread do in the same run.

Rate, lateness, latency of services and lockstep, as in ``docs/laboratory/performance-loop.md``.
``baseline`` is the least that can be done, to compare with.
"""
