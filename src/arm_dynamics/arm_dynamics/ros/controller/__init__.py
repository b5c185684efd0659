# SPDX-License-Identifier: Apache-2.0
"""Parts of the controller node: its parameters, its goals, and the log of its answers.

Depends on the core, the interfaces, ``common`` and ``joint_state``; neither on the node nor on the
services of the dynamics node.
"""
