# SPDX-License-Identifier: Apache-2.0
"""Steps of length h of one-step methods, built from x' = f(x, u, p)."""

from collections.abc import Callable, Sequence

import casadi as ca

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_sim.integrators import extrapolation as implicit
from arm_sim.integrators import nystrom
from arm_sim.integrators.continuous import middle_weights, needs_slope_at_end, stage_at_end
from arm_sim.integrators.error_norm import error_norms
from arm_sim.integrators.methods import Method
from arm_sim.integrators.tableaux import Tableau, weighted_sum

# The slope x' of a stage, from its number and state; numbers beyond the last mean the end
Stage = Callable[[int, ca.MX], ca.MX]
# Builds the function that an implicit method may use in place of the Jacobian, see
# ``extrapolated_step``.
Scaled = Callable[[], ca.Function | None]


@one_at_a_time
def build_step(
    method: Method, rhs: ca.Function, n: int, project: ca.Function | None = None,
    scaled: Scaled | None = None, name: str = "step", dense: bool = False,
    loads: ca.Function | None = None, scale: Array | None = None,
) -> ca.Function:  # fmt: skip
    """Build one step, of fixed length or, with ``scale``, one that estimates its error.

    That error is the largest over x of |error| / (scale + |x|); DOP853 mixes its estimates of
    order 5 and 3 (Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 1993,
    section II.10).

    Args:
        method: The method.
        rhs: Function (x, u, p) -> x'.
        n: Degrees of freedom; x starts with q and v of n each.
        project: Projection of (q, v) onto the constraints, see ``Mechanics.project``; the residual
            before it is included in the error.
        scaled: See ``slopes.scaled_jacobian``; called only if the method is implicit.
        name: Name of the function, if the default is taken in the same kernel.
        dense: Whether to return the continuous output as well, see ``Step.dense_output``.
        loads: Function (x, u, p) -> loads of joints, forces, …, x', see ``Plant.events``: the rhs
            of an explicit method. With it x' at the beginning is given, as it is known where
            modes were chosen.
        scale: Scale of each entry of x for error control, shape (nx,), 1 for q and v; for a method
            with an error estimate.

    Returns:
        Function (x, u, p, h) -> x at the end of the step, with ``scale`` the scaled error and the
        largest error of q, and with ``dense`` x' at its beginning and at its end, and x in its
        middle. With ``loads`` (x, u, p, h, x') -> the same without
        x' at its beginning, and loads and forces at the method's stage at its end, if any.
    """
    slope = _Stages(rhs, loads)
    step = _step(method, rhs, n, scaled, slope)
    after, errors = step.after, list[ca.MX]()
    if scale is not None:
        errors = error_norms(scale, len(step.estimates), n).call([step.x, after, *step.estimates])
    if project is not None:
        projected, gap, gap_v = project(step.x[: 2 * n], after[: 2 * n], slope.p)
        after = ca.vertcat(projected, after[2 * n :])
        gaps = ca.fmax(gap, gap_v), gap
        errors = [ca.fmax(error, residual) for error, residual in zip(errors, gaps, strict=False)]
    results = [after, *errors, *(_continuous_output(step, slope) if dense else ())]
    return ca.Function(name, slope.arguments, results, {"cse": True})


@one_at_a_time
def build_tick(step: ca.Function, actuate: ca.Function) -> ca.Function:
    """One tick: actuation, then the step. (x, r, p, h) -> (x after it, effective torque)."""
    x, p, h = (ca.MX.sym(name, step.size1_in(i)) for name, i in (("x", 0), ("p", 2), ("h", 3)))
    r = ca.MX.sym("r", actuate.size1_in(1))
    u = actuate(x, r)
    return ca.Function("tick", [x, r, p, h], [step(x, u, p, h), u])


class _Stages:
    """f at the stages of a step, and the symbols that it is a function of.

    Args:
        rhs: Function (x, u, p) -> x'.
        loads: See ``build_step``.

    Attributes:
        arguments: Symbols of the arguments of the step.
        loads: What ``loads`` gives besides x', by stage.
    """

    def __init__(self, rhs: ca.Function, loads: ca.Function | None) -> None:
        self._rhs, self._loads = rhs, loads
        self.x, self.u, self.p = (ca.MX.sym(s, rhs.size1_in(i)) for i, s in enumerate("xup"))
        self.h = ca.MX.sym("h")
        self.first = None if loads is None else ca.MX.sym("first", self.x.shape[0])
        first = [] if self.first is None else [self.first]
        self.arguments = [self.x, self.u, self.p, self.h, *first]
        self.loads = dict[int, list[ca.MX]]()

    def __call__(self, stage: int, y: ca.MX) -> ca.MX:
        """The slope of a stage, see ``Stage``; keeps the other results in ``loads``."""
        if stage == 0 and self.first is not None:
            return self.first
        if self._loads is None:
            return self._rhs(y, self.u, self.p)
        *self.loads[stage], slope = self._loads.call([y, self.u, self.p])
        return slope


@frozen
class Step:
    """Expressions of one step.

    Attributes:
        x: State at its beginning.
        h: Its length.
        after: State at its end.
        estimates: Estimates of its error.
        tableau: Coefficients of the method; None if it has none.
        slopes: Derivatives of the stages.
        middle: State in the middle; None if it follows from the slopes.
    """

    x: ca.MX
    h: ca.MX
    after: ca.MX
    estimates: list[ca.MX]
    tableau: Tableau | None = None
    slopes: Sequence[ca.MX] = ()
    middle: ca.MX | None = None

    @property
    def end_stage(self) -> int | None:
        """The last stage at the end of the step; None if f is not evaluated there."""
        if self.tableau is None:
            return 1
        count = len(self.tableau.a)
        return count if needs_slope_at_end(self.tableau) else stage_at_end(self.tableau)

    def dense_output(self, f: Stage) -> list[ca.MX]:
        """Continuous output: x' at the beginning and at the end, and x in the middle.

        An explicit method takes what its stages give (``continuous.middle_weights``): x' at the
        end from a stage there, without one from the parabola that passes through the step. A
        method under error control, whose steps are long, evaluates f at the end.
        """
        if self.tableau is None:
            first, last = f(0, self.x), f(1, self.after)
            middle = 0.5 * (self.x + self.after) + 0.125 * self.h * (first - last)
            return [first, last, middle if self.middle is None else self.middle]
        first, stages, end = self.slopes[0], list(self.slopes), self.end_stage
        if end == len(stages):
            stages.append(f(end, self.after))
        last = 2.0 * (self.after - self.x) / self.h - first if end is None else stages[end]
        weights = middle_weights(self.tableau)
        return [first, last, self.x + self.h * weighted_sum(weights, stages, self.x)]


def _step(method: Method, rhs: ca.Function, n: int, scaled: Scaled | None, slope: _Stages) -> Step:
    """One step of the method, before its projection onto constraints."""
    x, u, p, h = slope.x, slope.u, slope.p, slope.h
    if method.name == "implicit":
        jacobian = scaled() if scaled else None
        after, estimate, middle = implicit.extrapolated_step(rhs, n, x, u, p, h, jacobian)
        return Step(x, h, after, [estimate], middle=middle)
    if (tableau := method.tableau) is None:
        after = x + h * slope(0, x)  # v first, then q with the new v
        return Step(x, h, ca.vertcat(x[:n] + h * after[n : 2 * n], after[n:]), [])
    if tableau.positions:
        slopes = nystrom.slopes(tableau, rhs, slope, n, x, u, p, h)
        after = nystrom.stage(tableau, len(slopes), slopes, x, h, n)
        return Step(x, h, after, [], tableau, slopes)
    slopes = []
    for i, row in enumerate(tableau.a):
        slopes.append(slope(i, x + h * weighted_sum(row, slopes, x) if any(row) else x))
    after = x + h * weighted_sum(tableau.b, slopes, x)
    estimates = [h * weighted_sum(weights, slopes, x) for weights in tableau.errors]
    return Step(x, h, after, estimates, tableau, slopes)


def _continuous_output(step: Step, slope: _Stages) -> list[ca.MX]:
    """What ``build_step`` returns with ``dense`` besides the state at the end."""
    first, *others = step.dense_output(slope)
    if slope.first is None:
        return [first, *others]
    end_loads = slope.loads[step.end_stage][:2] if step.end_stage is not None else []
    return [*others, *end_loads]
