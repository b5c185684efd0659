# SPDX-License-Identifier: Apache-2.0
"""The table of terms: each function of an arm's state, stated once.

``Dynamics``, its batches and its calls of compiled code, exported C, the services, their client
and the reference are derived from the entries, which are verified against Pinocchio wherever they
become code. A formula is evaluated with numbers, which Pinocchio computes, and with expressions
alike.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntFlag
from typing import Any

import numpy as np

from arm_dynamics.terms import comparison
from arm_dynamics.terms.formulas import forward, inverse

# Arguments of formulas, in order, and the size of each, 0 for n. Positions in [rad] or [m],
# velocities and accelerations of the joints, and torques in [N m] or [N]; ``chosen`` has a factor,
# 0 or 1, for each ``Term``, and ``external`` torques that act on the links.
SIZES = {"q": 0, "v": 0, "a": 0, "tau": 0, "chosen": 5, "external": 0}
# Defaults of arguments: all terms, and no torques
FIXED = {"chosen": 1.0, "external": 0.0}
# ``chosen`` of everything else
WITHOUT_FRICTION = np.array([1.0, 1.0, 1.0, 0.0, 1.0])


class Term(IntFlag):
    """Terms of the equation of motion τ = M q̈ + C q̇ + G + S + F, for inverse dynamics to add up.

    ``SPRING``, S, is the torque of springs and their dampers.
    """

    INERTIA = 1
    CORIOLIS = 2
    GRAVITY = 4
    FRICTION = 8
    SPRING = 16
    ALL = 31


def always(model: Any) -> bool:
    """True, for every model."""
    return True


@dataclass(frozen=True, eq=False)
class Entry:
    """A function of the state of an arm.

    Attributes:
        name: Its name in C, services and commands.
        arguments: Names of its arguments, out of ``SIZES``.
        shape: Shape of its result at one state, in numbers and n.
        symbol: Symbol of its result.
        unit: Unit of its result, for revolute joints and for prismatic ones.
        about: One sentence that describes it.
        formula: Maps ``NumericArm`` or ``SymbolicArm``, and the arguments, to the result.
        selectors: Names of further arguments that are not numbers, such as a frame.
        compared: Maps ``NumericArm``, a result of code, the formula and its arguments to the error
            and the size of the summands, which does not vanish where the sum happens to.
        fields: Names of the parts of the result, where services name each.
        method: Its name in ``Dynamics``, if it is another one.
        compiles: Whether there is code of it for a model.
    """

    name: str
    arguments: tuple[str, ...]
    shape: tuple[str | int, ...]
    symbol: str
    unit: str
    about: str
    formula: Callable[..., Any]
    selectors: tuple[str, ...] = ()
    compared: Callable[..., Any] = comparison.relative
    fields: tuple[str, ...] = ()
    method: str = ""
    compiles: Callable[[Any], bool] = always

    @property
    def method_name(self) -> str:
        """Name of the method of ``Dynamics``."""
        return self.method or self.name

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters of that method."""
        return *(x for x in self.arguments if x not in FIXED), *self.selectors

    @property
    def parts(self) -> dict[str, tuple[str | int, ...]]:
        """Shapes of the parts of the result that services name."""
        return dict.fromkeys(self.fields, self.shape[1:]) or {self.name: self.shape}

    def dimensions(self, n: int) -> tuple[int, ...]:
        """Shape of the result for n joints, -1 for any number."""
        sizes = {"n": n, "n + 1": n + 1, "m": -1}
        return tuple(sizes[x] if isinstance(x, str) else x for x in self.shape)

    def title(self, *selection: Any) -> str:
        """Name of the entry in messages, with values of its selectors."""
        return " of ".join([self.name.replace("_", " "), *map(repr, selection)])


INVERSE = Entry(
    "inverse_dynamics", ("q", "v", "a", "chosen", "external"), ("n",), "tau", "N m, N",
    "Torques of a motion q, v, a: M a + C v + G + springs + friction.",
    inverse, compared=comparison.by_torques, method="inverse",
)  # fmt: skip
FORWARD = Entry(
    "forward_dynamics", ("q", "v", "tau", "external"), ("n",), "a", "rad/s², m/s²",
    "Accelerations under joint torques tau. A joint that dry friction holds at rest stays there; "
    "NaN where the laws of friction determine no motion.",
    forward, compared=comparison.of_accelerations, method="forward",
    compiles=lambda model: not model.scene.bilateral,
)  # fmt: skip
MASS_MATRIX = Entry(
    "mass_matrix", ("q",), ("n", "n"), "M", "kg m², kg",
    "Mass matrix M(q) with armature.", lambda arm, q: arm.rigid.mass(q),
)  # fmt: skip
CORIOLIS_MATRIX = Entry(
    "coriolis_matrix", ("q", "v"), ("n", "n"), "C", "N m s/rad, N s/m",
    "Coriolis matrix C(q, v); dM/dt - 2 C is skew-symmetric.",
    lambda arm, q, v: arm.rigid.coriolis(q, v), compared=comparison.scaled_by_speed,
    compiles=lambda model: model.n <= 16,  # an expression of the size of n³
)  # fmt: skip
GRAVITY = Entry(
    "gravity", ("q",), ("n",), "g", "N m, N",
    "Torques G(q) that balance the weight.",
    lambda arm, q: arm.rigid.gravity(q), compared=comparison.scaled_by_inertia,
)  # fmt: skip
FRICTION = Entry(
    "friction", ("q", "v"), ("n",), "f", "N m, N",
    "Friction of a steady motion without load; zero part of dry friction at rest.",
    lambda arm, q, v: arm.friction(v, q, 0.0 * v),
)  # fmt: skip
SPRING = Entry(
    "spring", ("q", "v"), ("n",), "s", "N m, N",
    "Torques S(q, v) that balance springs and their dampers.",
    lambda arm, q, v: arm.rigid.spring(q, v), compared=comparison.scaled_by_inertia,
)  # fmt: skip
ENERGY = Entry(
    "energy", ("q", "v"), (2,), "kinetic_and_potential", "J",
    "Kinetic and potential energy, that of springs included.",
    lambda arm, q, v: arm.rigid.energies(q, v), compared=comparison.of_energies,
    fields=("kinetic_energy", "potential_energy"),
)  # fmt: skip
POSE = Entry(
    "pose", ("q",), (4, 4), "T", "m",
    "Pose of a frame in the world: T of x_world = T x_frame.",
    lambda arm, q, frame: arm.rigid.pose(q, frame), ("frame",),
)  # fmt: skip
JACOBIAN = Entry(
    "jacobian", ("q",), (6, "n"), "J", "m/s, rad/s",
    "Jacobian of a frame: linear rows first, in axes of the world, at the frame's origin.",
    lambda arm, q, frame: arm.rigid.jacobian(q, frame), ("frame",),
)  # fmt: skip
JACOBIAN_DERIVATIVE = Entry(
    "jacobian_derivative", ("q", "v"), (6, "n"), "J_dot", "m/s², rad/s²",
    "Derivative of the Jacobian of a frame by time.",
    lambda arm, q, v, frame: arm.rigid.jacobian_derivative(q, v, frame), ("frame",),
    compared=comparison.of_jacobian_derivative,
)  # fmt: skip

TERMS = [
    INVERSE, FORWARD, MASS_MATRIX, CORIOLIS_MATRIX, GRAVITY, FRICTION, SPRING, ENERGY, POSE,
    JACOBIAN, JACOBIAN_DERIVATIVE,
]  # fmt: skip
"""All entries."""
# Those of the service ``dynamics_terms``, in the order of its response
OF_SERVICE = MASS_MATRIX, CORIOLIS_MATRIX, GRAVITY, FRICTION, SPRING, ENERGY
# Terms of the task space by the names of the service, with shapes in joints n and axes m
TASK_SPACE: dict[str, tuple[str | int, ...]] = {
    "pose": (7,), "jacobian": ("m", "n"), "twist": ("m",), "bias": ("m",), "inertia": ("m", "m"),
    "coriolis": ("m",), "gravity": ("m",), "spring": ("m",), "inverse": ("n", "m"),
    "null_space": ("n", "n"), "manipulability": (), "condition": (), "damped": (),
}  # fmt: skip

# Of the constraints with these names; no method of ``Dynamics``
CONSTRAINT_ROWS = Entry(
    "constraint_rows", ("q", "v"), ("m", "n + 1"), "A", "",
    "Rows A of bilateral constraints, with γ = Ȧ v beside them.",
    lambda arm, q, v, names: arm.rigid.constraint_rows(q, v, names), ("constraints",),
    compared=comparison.of_constraint_rows,
)  # fmt: skip
