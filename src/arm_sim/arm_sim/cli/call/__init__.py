# SPDX-License-Identifier: Apache-2.0
"""``./arm call``: the services of running nodes, without the ros2 command line."""
