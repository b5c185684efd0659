# SPDX-License-Identifier: Apache-2.0
"""An arm as formulas see it: with numbers, or with expressions; ``Arm`` is either."""

from collections.abc import Callable
from typing import Any

import casadi as ca

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.kernel import Kernel
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.model.rigid_expressions import RigidExpressions


class SymbolicArm:
    """An arm whose quantities are expressions of shape (n,).

    Attributes:
        rigid: Its rigid bodies and springs.
        has_springs: Whether there are springs.
        has_friction: Whether there is friction.
    """

    def __init__(self, model: ArmModel, friction: SteadyFriction) -> None:
        self.rigid: Any = RigidExpressions(model)
        self._friction = friction
        self.has_friction, self.has_springs = friction.is_present, bool(model.springs)

    def friction(self, v: Any, q: Any, load: Any) -> Any:
        """Friction of sliding joints under torques of the drives, shape (n,)."""
        return self._friction(v, ca.sign(v), q, load)

    def with_friction(self, v: Any, q: Any, tau: Any) -> Any:
        """Torques of the drives that leave ``tau`` for the rigid arm, shape (n,)."""
        return self._friction.overcome(tau, v, ca.sign(v), q)


class NumericArm:
    """An arm whose quantities are numbers of single states, of shape (n,), for one thread.

    Pinocchio computes all but friction, which is that of the expressions, on CasADi's virtual
    machine: for a single state NumPy takes ten times as long.
    """

    def __init__(self, model: ArmModel, friction: SteadyFriction) -> None:
        self.rigid, self._model, self._friction = RigidTerms(model), model, friction
        self.has_friction, self.has_springs = friction.is_present, bool(model.springs)

    @built_once
    def friction(self) -> Callable[[Array, Array, Array], Array]:
        """See ``SymbolicArm``."""
        return self._evaluated(SymbolicArm.friction)

    @built_once
    def with_friction(self) -> Callable[[Array, Array, Array], Array]:
        """See ``SymbolicArm``."""
        return self._evaluated(SymbolicArm.with_friction)

    def _evaluated(self, law: Callable[..., ca.SX]) -> Callable[[Array, Array, Array], Array]:
        symbols = [ca.SX.sym(name, self._model.n) for name in ("v", "q", "tau")]
        torque = ca.densify(law(SymbolicArm(self._model, self._friction), *symbols))
        function = ca.Function("torque", symbols, [torque], {"cse": True})
        call = Kernel([function], "vm").call("torque")
        (v_in, q_in, tau_in), (result,), run = call.inputs, call.outputs, call.run

        def evaluate(v: Array, q: Array, tau: Array) -> Array:
            v_in[:], q_in[:], tau_in[:] = v, q, tau
            run()
            return result.copy()

        return evaluate


type Arm = NumericArm | SymbolicArm
