# SPDX-License-Identifier: Apache-2.0
"""Inverse dynamics of many points at once, by compiled code that Pinocchio has checked."""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np

from arm_dynamics import compiler
from arm_dynamics.exceptions import KernelError
from arm_dynamics.kernel import CHECK_STATES, CHECK_TOLERANCE, Kernel
from arm_dynamics.laws import rigid_body
from arm_dynamics.laws.links import tree_of
from arm_dynamics.model import ArmModel, Array

Inverse = Callable[[Array, Array, Array, Array], Array]
_ENTRY = "inverse_rows"
_DRIVER = Path(__file__).parent / "native" / "rows.c"
_log = logging.getLogger(__name__)


def compiled_inverse(model: ArmModel, reference: Inverse) -> Inverse | None:
    """Compile M a + C v + G of an arm for batches.

    Args:
        model: The arm.
        reference: Function of q, v and a, each of shape (k, n), and gravity, shape (3,) in [m/s²],
            that returns torques of shape (k, n).

    Returns:
        A function like ``reference`` that agrees with it to 1e-10 of the terms' size, or None
        where there is no C compiler or no space for its work, or the code does not agree.
    """
    if compiler.find_compiler() is None:
        return None
    try:
        inverse = _compiled(model)
        check_inverse(model, reference, inverse)
    except (KernelError, OSError) as error:
        _log.warning("%s; batches are answered by Pinocchio, slower", error)
        return None
    return inverse


def _compiled(model: ArmModel) -> Inverse:
    function = _expression(model)
    kernel = Kernel([function], "native", _driver(function, model.n))
    entry = getattr(kernel.library, _ENTRY)
    entry.restype = None

    def inverse(q: Array, v: Array, a: Array, gravity: Array) -> Array:
        rows = [np.ascontiguousarray(x, dtype=float) for x in (q, v, a, gravity)]
        tau = np.empty_like(rows[0])
        given = [ctypes.c_void_p(x.ctypes.data) for x in rows]
        entry(*given, ctypes.c_longlong(len(tau)), ctypes.c_void_p(tau.ctypes.data))
        return tau

    return inverse


def check_inverse(model: ArmModel, reference: Inverse, inverse: Inverse) -> float:
    """Hold one function against another on random states, with and without gravity.

    Returns:
        Largest difference, relative to the size of the terms that are added up.

    Raises:
        KernelError: If it exceeds 1e-10.
    """
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-np.pi, np.pi, (3, CHECK_STATES, model.n))
    still, none = np.zeros_like(q), np.zeros(3)
    weight = np.array(model.scene.gravity, dtype=float)
    parts = (reference(q, still, a, none), reference(q, v, still, none))
    size = sum((abs(part) for part in parts), abs(reference(q, still, still, weight)))
    scale = np.maximum(size.max(axis=1, keepdims=True), np.finfo(float).tiny)
    worst = 0.0
    for gravity in (weight, none):
        difference = inverse(q, v, a, gravity) - reference(q, v, a, gravity)
        worst = max(worst, float(np.max(abs(difference) / scale)))
    if not worst <= CHECK_TOLERANCE:
        raise KernelError(
            f"generated inverse dynamics differs from Pinocchio by {worst:.2e} (relative); "
            f"{CHECK_TOLERANCE:.0e} is allowed"
        )
    return worst


def _expression(model: ArmModel) -> ca.Function:
    q, v, a = (ca.SX.sym(name, model.n) for name in "qva")
    gravity = ca.SX.sym("gravity", 3)
    tau = rigid_body.inverse(tree_of(model), q, v, a, gravity)
    return ca.Function("inverse", [q, v, a, gravity], [ca.densify(tau)], {"cse": True})


def _driver(function: ca.Function, n: int) -> str:
    sizes = {
        "N": n,
        "INVERSE": function.name(),
        "SZ_ARG": function.sz_arg() + 1,
        "SZ_RES": function.sz_res() + 1,
        "SZ_IW": function.sz_iw() + 1,
        "SZ_W": function.sz_w() + 1,
    }
    lines = [f"#define {name} {value}" for name, value in sizes.items()]
    return "\n".join(["", *lines, _DRIVER.read_text()])
