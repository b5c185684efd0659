# SPDX-License-Identifier: Apache-2.0
"""Friction of the joints: its static laws, its tables, and where a scene and URDF state it.

Depends on the scene; the arm model puts it together.
"""
