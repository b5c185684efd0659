# SPDX-License-Identifier: Apache-2.0
"""Computed torque compiled for an arm: one call instead of a dozen, half the time."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import cached_property
from weakref import WeakKeyDictionary

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.kernel import Call, Kernel
from arm_dynamics.control.computed_torque import (
    ComputedTorque,
    Measured,
    Moving,
    checked,
    demanded_acceleration,
    halfway,
    held_gains,
)
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.dynamics.verify import compare, random_states
from arm_dynamics.equations import rigid_body
from arm_dynamics.exceptions import KernelError
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.tree_builder import gravity_of, tree_of
from arm_dynamics.trajectory.reference import Reference

_log = logging.getLogger(__name__)


class CompiledComputedTorque(ComputedTorque):
    """The same law in code compiled for the arm.

    It is built for a model when the first torque is asked for, unless ``build`` has done so. Where
    it cannot be had, or differs from ``ComputedTorque``, the latter answers, and that is logged.
    """

    def torque(self, state: Moving, reference: Reference) -> Array:
        """Return joint torques in [N m], shape (n,); see ``ComputedTorque.torque``."""
        call = self._call
        if call is None:
            return super().torque(state, reference)
        q, v = checked(state, self._n)
        np.concatenate((q, v, reference.q, reference.v, reference.a), out=call.inputs[0])
        call.run()
        return call.outputs[0].copy()

    @cached_property
    def _call(self) -> Call | None:
        kernel = build(self._model)
        if kernel is None:
            return None
        call = kernel.call(_LAW)
        call.inputs[1][:] = np.hstack((self._kp, self._kd, self._dt))
        return call


def torque(
    model: ArmModel, q: ca.SX, v: ca.SX, desired: Sequence[ca.SX], tuning: Sequence[ca.SX]
) -> ca.SX:
    """The law as an expression.

    Args:
        model: The model it knows.
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities, shape (n,).
        desired: Position, velocity and acceleration of the reference, each of shape (n,).
        tuning: K_p and K_d of shape (n,), and the time dt for which a torque is held.

    Returns:
        Joint torques in [N m] or [N], shape (n,).
    """
    kp, kd, dt = tuning
    a = demanded_acceleration(q, v, desired, kp, kd)
    middle, speed = halfway(q, v, a, dt)
    gravity = gravity_of(model)
    tau = rigid_body.inverse(tree_of(model), middle, speed, a, gravity)
    sliding = ca.if_else(v == 0, desired[1], v)  # as in ComputedTorque
    needed: ca.SX = model.friction.demanded(tau, speed, ca.sign(sliding), middle)
    return needed


_LAW = "computed_torque"
_built: WeakKeyDictionary[ArmModel, Kernel | None] = WeakKeyDictionary()


def is_built(model: ArmModel) -> bool:
    """Tell whether the law of a model can be had at once."""
    return model in _built


def build(model: ArmModel) -> Kernel | None:
    """The law, built once for a model; None where it cannot be compiled, or is wrong."""
    if model not in _built:
        _built[model] = _compiled(model) if compiler.may_build() else None
    return _built[model]


def _compiled(model: ArmModel) -> Kernel | None:
    _log.info("building computed torque of %d joints", model.n)
    try:
        kernel = Kernel([_function(model)])
        _check(kernel, model)
    except (KernelError, OSError) as error:
        _log.warning("%s; computed torque goes on without compiled code, slower", error)
        return None
    return kernel


def _function(model: ArmModel) -> ca.Function:
    n = model.n
    moving, tuning = ca.SX.sym("moving", 5 * n), ca.SX.sym("tuning", 2 * n + 1)
    q, v, *desired = ca.vertsplit(moving, n)
    tau = torque(model, q, v, desired, ca.vertsplit(tuning, [0, n, 2 * n, 2 * n + 1]))
    return ca.Function(_LAW, [moving, tuning], [ca.densify(tau)], {"cse": True})


def _check(kernel: Kernel, model: ArmModel) -> None:
    """Check the code against ``ComputedTorque``; errors of ``compare``."""
    gains = 20.0, 1.0, 1e-3
    plain, call = ComputedTorque(Dynamics(model), *gains), kernel.call(_LAW)
    tuning = np.hstack((*held_gains(*gains[:2], model.n, gains[2]), gains[2]))
    moving = np.swapaxes(random_states(model.n, 5), 0, 1)
    made = np.array([call(each.ravel(), tuning)[0].copy() for each in moving])
    expected = np.array([plain.torque(Measured(*x[:2]), Reference(*x[2:])) for x in moving])
    compare("computed torque", (made - expected, np.maximum(abs(expected), 1.0)))
