# SPDX-License-Identifier: Apache-2.0
"""Whether a client that behaves as MoveIt's controller manager does gets all its goals.

Knows the nodes through their topics and the action alone.
"""
