# SPDX-License-Identifier: Apache-2.0
"""What every node of the suite needs: parameters, executor, diagnostics, messages, threads.

It knows the interfaces and the core's arrays, exceptions and poses, and none of the nodes.
Modules are imported one by one: some of them are needed before ROS is, or without it.
"""
