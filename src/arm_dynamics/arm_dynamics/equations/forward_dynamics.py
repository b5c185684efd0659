# SPDX-License-Identifier: Apache-2.0
"""Forward dynamics by the algorithms that may be the shortest for a tree."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from arm_dynamics.equations import articulated_body as articulated
from arm_dynamics.equations import rigid_body
from arm_dynamics.equations.tree import Tree

Law = Callable[[Tree, ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]

# Above this many joints the mass matrix, of order n³ to factor, is never the shorter way.
DENSE_AT_MOST = 16


def algorithms(tree: Tree, n: int) -> list[tuple[str, Law]]:
    """Names, for people, and laws (tree, q, v, tau, gravity) -> accelerations to choose from.

    Args:
        tree: The robot.
        n: Its degrees of freedom.
    """
    dense = ("composite bodies and LDLᵀ", rigid_body.forward_dense)
    recursive = ("articulated bodies", articulated.forward)
    if tree.has_followers:
        return [dense]
    return [recursive] if n > DENSE_AT_MOST else [dense, recursive]
