# SPDX-License-Identifier: Apache-2.0
"""The model of a test of a drive, a record of the test, and its simulation with derivatives."""

from collections.abc import Mapping

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.codegen.one_at_a_time import one_at_a_time


@frozen
class Law:
    """The model of a test, as expressions.

    Attributes:
        x: States, shape (nx,).
        u: Inputs, constant between samples, shape (nu,).
        parameters: Expressions by name, of positive numbers.
        slope: x', shape (nx,).
        outputs: Measured outputs, shape (ny,).
        accuracy: Error of the simulation relative to a signal, below which a residual is
            meaningless; larger where a slope has kinks.
        longest_step: Of the Runge-Kutta method, over the shortest time constant.
    """

    x: ca.SX
    u: ca.SX
    parameters: Mapping[str, ca.SX]
    slope: ca.SX
    outputs: ca.SX
    accuracy: float = 1e-8
    longest_step: float = 0.08

    @property
    def p(self) -> ca.SX:
        """All parameters, shape (np,)."""
        return ca.vertcat(*self.parameters.values())


@frozen
class Trial:
    """One record of a test.

    Attributes:
        law: Its model.
        dt: Sampling interval in [s].
        u: Inputs, shape (k, nu); the last row is not used.
        y: Outputs, NaN where they were not measured, shape (k, ny).
        x0: First guess of the initial state, shape (nx,).
        typical_states: States from which the length of steps follows, shape (m, nx).
        name: For messages.
    """

    law: Law
    dt: float
    u: Array
    y: Array
    x0: Array
    typical_states: Array
    name: str = "record"

    @property
    def size(self) -> Array:
        """How much each output varies, shape (ny,)."""
        return np.array([deviation(column) for column in self.y.T])


def deviation(column: Array) -> float:
    """Standard deviation of the samples that were measured; 0 if none was."""
    measured = column[np.isfinite(column)]
    return float(np.sqrt(np.mean((measured - measured.mean()) ** 2))) if measured.size else 0.0


@one_at_a_time
def simulation(trial: Trial, steps: int) -> ca.Function:
    """Outputs of a trial and their derivatives at every sample, as a function "roll".

    Its arguments are the state and its sensitivities at the start, inputs, and parameters; between
    two samples are so many Runge-Kutta steps. Derivatives are exactly those of the steps:
    S⁺ = ∂Φ/∂x S + ∂Φ/∂p.
    """
    law, h = trial.law, trial.dt / steps
    nx, m, k = law.x.shape[0], law.p.shape[0], len(trial.y)
    f = ca.Function("f", [law.x, law.u, law.p], [law.slope])
    z = ca.SX.sym("z", nx * (1 + m + nx))
    x, S = z[:nx], ca.reshape(z[nx:], nx, m + nx)
    k1 = f(x, law.u, law.p)
    k2 = f(x + h / 2 * k1, law.u, law.p)
    k3 = f(x + h / 2 * k2, law.u, law.p)
    k4 = f(x + h * k3, law.u, law.p)
    x_next = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    S_next = ca.jacobian(x_next, x) @ S + ca.horzcat(ca.jacobian(x_next, law.p), ca.SX(nx, nx))
    step = ca.Function("step", [z, law.u, law.p], [ca.vertcat(x_next, ca.vec(S_next))])
    y_x, y_p = ca.jacobian(law.outputs, law.x), ca.jacobian(law.outputs, law.p)
    sensitivity = y_x @ S + ca.horzcat(y_p, ca.SX(y_p.shape[0], nx))
    y = ca.substitute(ca.horzcat(law.outputs, sensitivity), law.x, x)
    output = ca.Function("output", [z, law.u, law.p], [ca.vec(ca.densify(y))])
    Z, u, p = (ca.MX.sym(name, size) for name, size in
               (("Z", z.shape[0]), ("u", law.u.shape[0]), ("p", m)))  # fmt: skip
    end = step.fold(steps) if steps > 1 else step
    tick = ca.Function("tick", [Z, u, p], [end(Z, u, p), output(Z, u, p)])
    U = ca.MX.sym("U", law.u.shape[0], k)
    _, outputs = tick.mapaccum(k)(Z, U, p)
    return ca.Function("roll", [Z, U, p], [outputs])
