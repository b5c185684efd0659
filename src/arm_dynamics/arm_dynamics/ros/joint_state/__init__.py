# SPDX-License-Identifier: Apache-2.0
"""Serialized JointStates: written into a template; received and read in a single C call.

Depends on the interfaces, ``common`` and the core's compiler, and on none of the nodes.
"""
