# SPDX-License-Identifier: Apache-2.0
"""How things are measured: processor times of interleaved jobs, and running nodes from outside.

``timing`` knows nothing but clocks; ``watcher`` joins the ROS graph and reads ``/proc``.
"""
