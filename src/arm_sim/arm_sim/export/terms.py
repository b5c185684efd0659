# SPDX-License-Identifier: Apache-2.0
"""The terms of the equation of motion as functions of one point, for export.

Their expressions are those that ``Dynamics`` and the simulator evaluate. Matrices are transposed,
since CasADi stores them by columns and C by rows.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import casadi as ca

from arm_dynamics import ArmModel, InvalidInput
from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.control.computed_torque import law_in_c
from arm_dynamics.equations import rigid_body
from arm_dynamics.exceptions import choices
from arm_dynamics.model.frame_motion import check_frame
from arm_dynamics.terms import table
from arm_dynamics.terms.arm import SymbolicArm
from arm_dynamics.terms.compiled import function as terms_function
from arm_dynamics.terms.table import Entry
from arm_sim.export.names import of_frames
from arm_sim.plant.bilateral import Bilateral
from arm_sim.plant.options import Options
from arm_sim.plant.parameters import Parameters
from arm_sim.plant.symbols import Joints, Symbols

TERMS = tuple(entry.name for entry in table.TERMS if not entry.selectors)
"""Names of the terms in C, without the library's name."""
DERIVATIVES = tuple(f"{entry.name}_derivatives" for entry in (table.INVERSE, table.FORWARD))
"""Names of the derivatives."""
_FOLLOWING = (
    "Torques [N m, N] that follow a motion q_d, v_d, a_d, held for a time dt [s]: those of the "
    "acceleration a_d + kd (v_d - v) + kp (q_d - q) in the middle of that time."
)


@dataclass(frozen=True)
class Term:
    """A function of the library.

    Attributes:
        name: Its name without the library's.
        about: Its comment in the header.
        function: CasADi function of vectors of n, with the names of its arguments in C.
        results: Names of its results in C.
        entry: The entry of the table of terms that it is, if it is one.
        which: The entry's arguments that are not numbers.
    """

    name: str
    about: str
    function: ca.Function
    results: tuple[str, ...]
    entry: Entry | None = None
    which: tuple[str, ...] = ()

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of its arguments in C."""
        return tuple(self.function.name_in())


def checked_names(names: Collection[str]) -> tuple[str, ...]:
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
        names: Terms and derivatives, as ``checked_names`` returns them.
        frames: Frames whose poses and Jacobians are wanted; the first also without its name.

    Raises:
        InvalidInput: If a frame is unknown, or two look alike in C.
    """
    return [*_of_joints(model, names), *_of_frames(model, frames)]


def _of_joints(model: ArmModel, names: Collection[str]) -> Iterator[Term]:
    """Terms that depend on joints alone, their derivatives, and the computed torque."""
    for entry in (entry for entry in table.TERMS if not entry.selectors):
        slopes = f"{entry.name}_derivatives"
        if entry.name in names or slopes in names:
            function = _function(model, entry, entry.name)
        if entry.name in names:
            yield Term(entry.name, _about(entry), function, (entry.symbol,), entry)
        if slopes in names:
            by = function.name_in()
            about = "Derivatives of {} by {}, {} and {}, each n x n, row by row."
            results = tuple(f"d{entry.symbol}_d{x}" for x in by)
            yield Term(slopes, about.format(entry.name, *by), _derivatives(function), results)
    if table.INVERSE.name in names:
        yield Term("computed_torque", _FOLLOWING, law_in_c(model), ("tau",))


def _of_frames(model: ArmModel, frames: Sequence[str]) -> Iterator[Term]:
    """Terms of frames, the first under two names."""
    for k, part in enumerate(of_frames(frames)):
        check_frame(model, frames[k], model.frame_names)
        for entry in (entry for entry in table.TERMS if entry.selectors):
            # CasADi refuses names such as tool__tip.
            function = _function(model, entry, f"{entry.name}_{k}", frames[k])
            for suffix in [f"_{part}"] if k else ["", f"_{part}"]:
                name, about = f"{entry.name}{suffix}", _about(entry, frames[k])
                yield Term(name, about, function, (entry.symbol,), entry, (frames[k],))


def _function(model: ArmModel, entry: Entry, name: str, *which: str) -> ca.Function:
    """An entry as a function of one result."""
    if entry is table.FORWARD and model.scene.bilateral:
        return _constrained(model)
    arm = SymbolicArm(model, SteadyFriction.of(model))
    parts = terms_function(arm, model.n, f"parts_{name}", [(entry, which)])
    arguments = parts.sx_in()
    result = ca.vertcat(*parts.call(arguments, True, False))
    return ca.Function(f"term_{name}", arguments, [result], parts.name_in(), ["o0"], {"cse": True})


def _derivatives(function: ca.Function) -> ca.Function:
    arguments, names = function.sx_in(), [f"o{i}" for i in range(function.n_in())]
    result = function(*arguments)
    slopes = [ca.densify(ca.jacobian(result, x).T) for x in arguments]
    name = f"{function.name()}_derivatives"
    return ca.Function(name, arguments, slopes, function.name_in(), names, {"cse": True})


def _constrained(model: ArmModel) -> ca.Function:
    """Accelerations of an arm with loops; joints with dry friction slide in their directions."""
    arm, parameters = SymbolicArm(model, SteadyFriction.of(model)), Parameters(model)
    s = Symbols(model, parameters)
    joints = Joints(model, s, Options(stops=False))
    bias = rigid_body.inverse_dynamics(s.tree, s.q, s.v, ca.SX(model.n, 1), s.gravity)
    a = Bilateral(model, s, joints).accelerations(s.tau - bias)
    accelerations = ca.Function("a", [s.q, s.v, s.tau, joints.p], [a], {"cse": True})
    # Tunable numbers as in the scene; all joints slide, and no contact is closed.
    sliding, apart = ca.DM.ones(joints.direction.shape[0]), ca.DM.zeros(joints.contacts.shape[0])
    p = ca.vertcat(ca.DM(parameters.nominal), sliding, apart)
    names = ["q", "v", "tau"]
    q, v, tau = (ca.SX.sym(name, model.n) for name in names)
    load = tau - arm.friction(v, q, tau) - arm.rigid.spring(q, v)
    results = [ca.densify(accelerations(q, v, load, p))]
    name = f"term_{table.FORWARD.name}"
    return ca.Function(name, [q, v, tau], results, names, ["o0"], {"cse": True})


def _about(entry: Entry, *which: str) -> str:
    """The comment of an entry."""
    text = entry.about
    for kind, name in zip(entry.selectors, which, strict=True):
        text = text.replace(f"a {kind}", f"{kind} '{name}'")
    rows = f"; {' x '.join(map(str, entry.shape))}, row by row" if len(entry.shape) == 2 else ""
    return f"{text} In {entry.unit.replace('²', '^2')}{rows}."
