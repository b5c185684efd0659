# SPDX-License-Identifier: Apache-2.0
"""Backward pass of iLQR with limits, in C: change of the commands and feedback gains."""

import ctypes
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.addresses import pointer
from arm_studies.optimization.cost import Expansion

# Flags of the compiler for code that includes this folder, see ``compiler.build``.
INCLUDE_FLAGS = (f"-I{Path(__file__).parent / 'native'}",)
# Unlike the straight-line code of the equations, loops over small matrices benefit from SIMD.
_FLAGS = tuple("-O3" if flag == "-O1" else flag for flag in compiler.FLAGS)


@dataclass(frozen=True)
class Policy:
    """The change of commands du = k + K dx that improves a trajectory.

    Attributes:
        k: Shape (nodes, n).
        K: Shape (nodes, n, nx).
        change: Change of the cost predicted by the quadratic model, not positive.
    """

    k: Array
    K: Array
    change: float


def backward(
    slopes: Array, cost: Expansion, low: Array, high: Array, damping: float
) -> Policy | None:
    """Find the policy that minimizes the quadratic model of a trajectory's cost.

    Args:
        slopes: A and B of each node side by side, shape (nodes, nx, nx + n).
        cost: The cost about the trajectory.
        low: Lower bound of the change of each command, shape (nodes, n).
        high: Upper bound, likewise.
        damping: Regularization, a multiple of the cost's curvature by the command that is added to
            it.

    Returns:
        The policy; None if the curvature by a command is not positive.

    Raises:
        CompilerMissing: If there is no C compiler.
    """
    nodes, nx, width = slopes.shape
    n = width - nx
    k, K, change = np.empty((nodes, n)), np.empty((nodes, n, nx)), np.empty(1)
    inputs = [
        np.ascontiguousarray(array, float)
        for array in (slopes, cost.x, cost.xx, cost.u, cost.uu, low, high)
    ]
    reached = library_of(nx, n).ilqr_backward(
        ctypes.c_longlong(nodes), *map(pointer, inputs), ctypes.c_double(damping),
        pointer(k), pointer(K), pointer(change),
    )  # fmt: skip
    return Policy(k, K, float(change[0])) if reached == nodes else None


@lru_cache
def library_of(nx: int, n: int) -> ctypes.CDLL:
    """Compiled backward pass of states of ``nx`` and commands of ``n`` numbers.

    Raises:
        CompilerMissing: If there is no C compiler.
    """
    text = f'#define NX {nx}\n#define NU {n}\n#include "backward.c"\n'
    library = compiler.build(text, "c", _FLAGS, INCLUDE_FLAGS).library
    library.ilqr_backward.restype = ctypes.c_longlong
    return library
