# SPDX-License-Identifier: Apache-2.0
"""The terms of the equation of motion as functions of one point, for export.

Their expressions are those that ``Dynamics`` and the simulator evaluate. Matrices are transposed,
since CasADi stores them by columns and C by rows.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from arm_dynamics import ArmModel, InvalidInput
from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.codegen.kernel import operations
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.control.computed_torque import law_in_c
from arm_dynamics.dynamics import compiled_terms
from arm_dynamics.equations import frame, rigid_body, spring
from arm_dynamics.equations.forward_dynamics import algorithms
from arm_dynamics.exceptions import choices
from arm_dynamics.model.tree_builder import frame_of, gravity_of, tree_of
from arm_sim.export.names import of_frames
from arm_sim.plant.bilateral import Bilateral
from arm_sim.plant.options import Options
from arm_sim.plant.parameters import Parameters
from arm_sim.plant.symbols import Joints, Symbols

TERMS = (
    "inverse_dynamics", "forward_dynamics", "mass_matrix", "coriolis_matrix", "gravity",
    "friction", "energy",
)  # fmt: skip
"""Names of the terms in C, without the library's name."""
_FOLLOWING = (
    "Torques [N m, N] that follow a motion q_d, v_d, a_d, held for a time dt [s]: those of the "
    "acceleration a_d + kd (v_d - v) + kp (q_d - q) in the middle of that time."
)
DERIVATIVES = ("inverse_dynamics_derivatives", "forward_dynamics_derivatives")
"""Names of the derivatives."""


@dataclass(frozen=True)
class Term:
    """A function of the library.

    Attributes:
        name: Its name without the library's.
        about: Its comment in the header.
        function: CasADi function of vectors of n, with the names of its arguments in C.
        results: Names of its results in C.
        frame: Index of the frame whose pose or Jacobian it is; None for a term.
    """

    name: str
    about: str
    function: ca.Function
    results: tuple[str, ...]
    frame: int | None = None

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of its arguments in C."""
        return tuple(self.function.name_in())


def chosen(names: Collection[str]) -> tuple[str, ...]:
    """Check names of terms and derivatives; returns them in the order of the header.

    Raises:
        InvalidInput: If one is unknown.
    """
    allowed = (*TERMS, *DERIVATIVES)
    for name in names:
        if name not in allowed:
            raise InvalidInput(f"terms names {name!r}; allowed: {choices(name, allowed)}")
    return tuple(name for name in allowed if name in names)


@one_at_a_time
def terms_of(model: ArmModel, names: Collection[str], frames: Sequence[str]) -> list[Term]:
    """The functions of an arm.

    Args:
        model: The arm.
        names: Terms and derivatives, as ``chosen`` returns them.
        frames: Frames whose poses and Jacobians are wanted; the first also without its name.

    Raises:
        InvalidInput: If a frame is unknown, or two look alike in C.
    """
    point = _Point(model)
    found = list[Term]()
    for name in names:
        about, given, results, expressions = _MADE[name]
        function = point.function(name, given, *expressions(point))
        found.append(Term(name, about, function, tuple(results.split())))
    if "inverse_dynamics" in names:
        found.append(Term("computed_torque", _FOLLOWING, law_in_c(model), ("tau",)))
    for k, part in enumerate(of_frames(frames)):
        found += _of_frame(point, k, frames[k], ("", f"_{part}")[k > 0 :])
    return found


class _Point:
    """Symbols of a point, and expressions of an arm there."""

    def __init__(self, model: ArmModel) -> None:
        self.model, self.friction = model, SteadyFriction.of(model)
        self.tree, self.gravity = tree_of(model), gravity_of(model)
        self.q, self.v, self.a, self.tau = (ca.SX.sym(x, model.n) for x in ("q", "v", "a", "tau"))

    def function(self, name: str, of: str, *results: ca.SX) -> ca.Function:
        """CasADi function of the symbols whose names ``of`` lists, with dense results."""
        given, dense = of.split(), [ca.densify(result) for result in results]
        symbols, made = [getattr(self, x) for x in given], [f"o{i}" for i in range(len(dense))]
        return ca.Function(f"term_{name}", symbols, dense, given, made, {"cse": True})

    def known(self, term: compiled_terms.BatchTerm, *given: ca.SX) -> ca.SX:
        """The expression of a term that batches use."""
        return term.expression(self.model)(*given)

    @cached_property
    def inverse(self) -> ca.SX:
        """Torques of a motion, all terms."""
        q, v, a, springs = self.q, self.v, self.a, self.model.springs
        rigid = spring.frictionless(springs, self.tree, q, v, a, self.gravity)
        return ca.SX(self.friction.demanded(rigid, v, ca.sign(v), q))

    @cached_property
    def forward(self) -> ca.SX:
        """Accelerations under torques; joints with dry friction slide in their directions."""
        q, v, springs = self.q, self.v, self.model.springs
        free = self.tau - self.friction(v, ca.sign(v), q, self.tau)
        if springs:
            free = free - spring.torque(springs, self.tree, q, v)
        if self.model.scene.bilateral:
            return self._constrained(free)
        laws = (law for _, law in algorithms(self.tree, self.model.n))
        ways = [law(self.tree, q, v, free, self.gravity) for law in laws]
        return min(ways, key=lambda a: operations(self.function("a", "q v tau", a)))

    def _constrained(self, free: ca.SX) -> ca.SX:
        """Accelerations of an arm with loops under torques besides gravity and inertia."""
        model, parameters = self.model, Parameters(self.model)
        s = Symbols(model, parameters)
        joints = Joints(model, s, Options(stops=False))
        bias = rigid_body.inverse(s.tree, s.q, s.v, ca.SX(model.n, 1), s.gravity)
        a = Bilateral(model, s, joints).accelerations(s.tau - bias)
        slides = ca.DM.ones(joints.direction.shape[0])
        apart = ca.DM.zeros(joints.contacts.shape[0])
        nominal = ca.vertcat(ca.DM(parameters.nominal), slides, apart)
        found = ca.Function("a", [s.q, s.v, s.tau, joints.p], [a], {"cse": True})
        return found(self.q, self.v, free, nominal)


def _of_frame(at: _Point, place: int, name: str, suffixes: Sequence[str]) -> list[Term]:
    """Pose and Jacobian of a frame, under one name or several."""
    body = frame_of(at.model, name)
    p, R = frame.placement(at.tree, body, at.q)
    T = ca.vertcat(ca.horzcat(R, p), ca.SX([[0, 0, 0, 1]]))
    J = frame.jacobian(at.tree, body, at.q)
    pose = at.function(f"pose_{place}", "q", T.T)  # CasADi refuses names such as tool__tip
    jacobian = at.function(f"jacobian_{place}", "q", J.T)
    posed = f"Pose of frame '{name}' in the world, 4 x 4, row by row."
    moved = (
        f"Jacobian of frame '{name}', 6 x n, row by row: linear rows first, in axes of the world, "
        "at the frame's origin."
    )
    return [
        term
        for suffix in suffixes
        for term in (
            Term(f"pose{suffix}", posed, pose, ("T",), place),
            Term(f"jacobian{suffix}", moved, jacobian, ("J",), place),
        )
    ]


type _Expressions = Callable[[_Point], list[ca.SX]]
_MADE: dict[str, tuple[str, str, str, _Expressions]] = {  # comment, arguments, results
    "inverse_dynamics": (
        "Torques [N m, N] of a motion q, v, a: M a + C v + G + springs + friction.",
        "q v a", "tau", lambda at: [at.inverse],
    ),
    "forward_dynamics": (
        "Accelerations [rad/s^2, m/s^2] under joint torques tau. A joint that dry friction holds "
        "at rest stays there; NaN where the laws of friction determine no motion.",
        "q v tau", "a", lambda at: [at.forward],
    ),
    "mass_matrix": (
        "Mass matrix M(q) with armature [kg m^2, kg], row by row.",
        "q", "M", lambda at: [at.known(compiled_terms.MASS_MATRIX, at.q)],
    ),
    "coriolis_matrix": (  # transposed already
        "Coriolis matrix C(q, v), row by row; dM/dt - 2 C is skew-symmetric.",
        "q v", "C", lambda at: [at.known(compiled_terms.CORIOLIS_MATRIX, at.q, at.v)],
    ),
    "gravity": (
        "Torques G(q) [N m, N] that balance the weight.",
        "q", "g", lambda at: [at.known(compiled_terms.GRAVITY, at.q)],
    ),
    "friction": (
        "Friction [N m, N] of a steady motion without load; zero part of dry friction at rest.",
        "q v", "f",
        lambda at: [ca.SX(at.friction(at.v, ca.sign(at.v), at.q, ca.SX(at.model.n, 1)))],
    ),
    "energy": (
        "Kinetic and potential energy [J], that of springs included.",
        "q v", "kinetic_and_potential",
        lambda at: [at.known(compiled_terms.ENERGIES, at.q, at.v)],
    ),
    "inverse_dynamics_derivatives": (
        "Derivatives of inverse_dynamics by q, v and a, each n x n, row by row.",
        "q v a", "dtau_dq dtau_dv dtau_da",
        lambda at: [ca.jacobian(at.inverse, by).T for by in (at.q, at.v, at.a)],
    ),
    "forward_dynamics_derivatives": (
        "Derivatives of forward_dynamics by q, v and tau, each n x n, row by row.",
        "q v tau", "da_dq da_dv da_dtau",
        lambda at: [ca.jacobian(at.forward, by).T for by in (at.q, at.v, at.tau)],
    ),
}  # fmt: skip
