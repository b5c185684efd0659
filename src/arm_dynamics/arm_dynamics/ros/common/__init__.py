# SPDX-License-Identifier: Apache-2.0
"""Common parts of all nodes: parameters, executor, diagnostics, messages, threads.

Depends on the interfaces and on arrays, exceptions and poses of the core; on none of the nodes.
Modules are imported one by one: some are needed before ROS, or without it.
"""
