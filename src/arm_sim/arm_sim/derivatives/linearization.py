# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of ticks, across the events in them.

Smooth motion is differentiated in compiled code (``tangents``): the derivative is that of the step
that is integrated. Where an event ends a motion, its instant depends on the state: with a guard g
that is zero there, and the step Φ of length h, the instant changes by
dh = −(g_x Φ_x dx)/(g_x Φ_h), the state by Φ_x dx + Φ_h dh, an impact by its own derivative, and
the remaining tick is shorter by dh. Together these are the saltation matrix (Leine, Nijmeijer,
Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, chapter 7; Kong, Payne, Zhu,
Johnson, "Saltation matrices: the essential tool for linearizing hybrid dynamical systems",
Proc. IEEE 112, 2024), of the method's step instead of the exact motion.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed
from arm_dynamics.codegen.addresses import repeated
from arm_dynamics.codegen.compiler import HOW_TO_GET_CODE
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.exceptions import CompilerMissing
from arm_sim.derivatives.coarse_steps import CoarseSteps
from arm_sim.derivatives.motion import Motion, named_in_errors, propagate_arm
from arm_sim.derivatives.one_sided import TickPoint
from arm_sim.derivatives.refusals import divergence
from arm_sim.derivatives.tangents import Arms, Tangents
from arm_sim.derivatives.tangents.python_linearize import Linearize, python_linearize
from arm_sim.derivatives.tick_derivatives import TickDerivatives
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.stepping.adaptive import within_reach
from arm_sim.stepping.python_function import unanswered
from arm_sim.stepping.rollouts.lane_widths import check_lanes
from arm_sim.stepping.stepper import Stepper


@sealed
class Linearizer:
    """Derivatives of ticks of many arms; arguments as of ``TickDerivatives``.

    Attributes:
        ticks: Derivatives of single ticks.
    """

    @one_at_a_time
    def __init__(
        self, plant: Plant, choice: Choice, stepper: Stepper, backend: str,
        p_indices: Sequence[int] = (),
    ) -> None:  # fmt: skip
        self._plant, self._choice, self._stepper = plant, choice, stepper
        self._backend, self._p_indices = backend, p_indices
        self.ticks = TickDerivatives(plant, choice, stepper, backend, p_indices)
        self._coarse_steps = CoarseSteps(plant, choice)
        self._smooth_tangents = dict[float, Tangents]()  # by the speed that regularizes friction

    def __call__(self, x: Array, r: Array, ticks: int, side: int | None = None) -> Array:
        """Differentiate ``ticks`` ticks from ``x`` under the held command ``r``.

        Args:
            x: State, shape (nx,).
            r: Command, shape (n,).
            ticks: Number of ticks.
            side: See ``Motion``.

        Returns:
            Derivatives by state, command and quantities side by side, shape (nx, nx + n + nt).

        Raises:
            SimulationDiverged: If a tick cannot be computed.
            NotDifferentiable: If a tick has no derivative.
        """
        slopes = self.differentiate_arms(x[None], r[None], ticks, threads=1, lanes=1, side=side)
        return np.asarray(slopes[0])

    def differentiate_arms(
        self, x: Array, r: Array, ticks: int, threads: int | None, lanes: int | None,
        side: int | None = None,
    ) -> Array:  # fmt: skip
        """Differentiate ticks of many arms.

        Args:
            x: States, shape (b, nx).
            r: Commands, shape (b, n).
            ticks: Number of ticks.
            threads: Cores to use; None for all that the work is worth.
            lanes: Arms in a vector register; None for the widest there is.
            side: See ``Motion``.

        Returns:
            Derivatives of each arm as of ``__call__``, shape (b, nx, nx + n + nt).

        Raises:
            SimulationDiverged: If a tick cannot be computed.
            NotDifferentiable: If a tick has no derivative.
        """
        self._coarse_steps.check(x)
        slopes, unfinished = self._smooth_slopes(x, r, ticks, threads, lanes)
        for arm in unfinished:
            with named_in_errors(arm, len(x)):
                slopes[arm] = self._differentiate_arm(x[arm], r[arm], ticks, side)
        return slopes

    def _smooth_slopes(
        self, x: Array, r: Array, ticks: int, threads: int | None, lanes: int | None, *,
        is_first: bool = True,
    ) -> tuple[Array, list[int]]:  # fmt: skip
        """Derivatives of many arms in compiled code, if any, and the arms that are left."""
        compiled, p = self.ticks.compiled.smooth_ticks, self._stepper.p
        if compiled is None:
            check_lanes(lanes)
            slopes = np.empty((len(x), self._plant.nx, self.ticks.column_count))
            return slopes, list(range(len(x)))
        _, slopes, rest = compiled.differentiate(x, r, p, ticks, threads, lanes, is_first=is_first)
        return slopes, self._unsmooth_arms(rest, x, r[:, None], ticks)

    def _differentiate_arm(self, x: Array, r: Array, ticks: int, side: int | None) -> Array:
        """Derivatives of ticks of one arm, through their events."""
        if ticks == 1:
            return Motion(self.ticks, x, self._stepper.p, side).differentiate_tick(r)
        nx, unit = len(x), np.eye(self.ticks.column_count)
        arm = self._held_arms(x[None], r[None], ticks, unit[:nx], unit[nx:])
        *_, slope = propagate_arm(self.ticks, arm, 0, side)
        return slope

    def jacobians_along(self, x: Array, r: Array, threads: int | None) -> Array:
        """Derivatives of ticks of one motion, each from a state in which the one before ends.

        Ticks that have no derivative because they begin or end on the boundary of a mode, such as
        one in which a joint breaks away, are given that of the motion's own modes: the one-sided
        derivative in the direction in which the arm moves.

        Args:
            x: States, shape (b, nx).
            r: Commands, shape (b, n).
            threads: Cores to use; None for all that the work is worth.

        Returns:
            As ``differentiate_arms``.

        Raises:
            SimulationDiverged: If a tick cannot be computed.
            NotDifferentiable: If there is no such derivative either, as where a motion grazes.
        """
        slopes, unfinished = self._smooth_slopes(x, r, 1, threads, None, is_first=False)
        for arm in unfinished:
            point, control = TickPoint(x[arm], r[arm], self._stepper.p), self.ticks.new_control()
            with named_in_errors(arm, len(x)):
                slopes[arm] = self.ticks.differentiate_either_side(point, control, is_first=False)
        return slopes

    def smoothed_jacobians(self, x: Array, r: Array, speed: float, threads: int | None) -> Array:
        """Derivatives as ``jacobians_along``, of the arm without stops, whose friction is smooth.

        ``speed`` in [rad/s] or [m/s] regularizes dry friction, see ``Options``.

        Raises:
            CompilerMissing: Without compiled code.
            SimulationDiverged: If a tick cannot be computed; it names the arm.
        """
        if speed not in self._smooth_tangents:
            plant = self._plant.variant(stops=False, sliding=True, regularization=speed)
            tangents = Tangents(plant, self._choice, self._backend, self._p_indices)
            self._smooth_tangents[speed] = tangents
        if not (compiled := self._smooth_tangents[speed]).native:
            raise CompilerMissing(f"smooth derivatives need compiled code: {HOW_TO_GET_CODE}")
        after, slopes, marked = compiled.differentiate(x, r, self._stepper.p, 1, threads, None)
        for arm in marked:  # also those that pass a stop, which does not act
            with named_in_errors(arm, len(x)):
                if not within_reach(after[arm]):
                    raise divergence(self._choice)
        return slopes

    def _held_arms(self, x: Array, r: Array, ticks: int, dx: Array, dr: Array) -> Arms:
        """Arms under held commands, all with the same columns."""
        arms, p = len(x), self._stepper.p
        held = repeated(dr[None, None], (arms, ticks, *dr.shape))
        commands = repeated(r[:, None], (arms, ticks, r.shape[1]))
        initial = repeated(dx[None], (arms, *dx.shape))
        return Arms(x, commands, repeated(p[None], (arms, len(p))), initial, held)

    def prepare(self) -> None:
        """Compile what ticks need, unless that is done."""
        self.ticks.compiled.prepare()
        self.ticks.prepare_events()

    def jvp(
        self, x: Array, r: Array, ticks: int, dx: Array, dr: Array, side: int | None = None
    ) -> Array:
        """Derivatives by state and command of ticks of one arm, times a column, shape (nx,).

        Args:
            x: State, shape (nx,).
            r: Command, held, shape (n,).
            ticks: Number of ticks.
            dx: Change of the state, shape (nx,).
            dr: Change of the command, shape (n,).
            side: See ``Motion``.

        Raises:
            SimulationDiverged: If a tick cannot be computed.
            NotDifferentiable: If a tick has no derivative.
        """
        dx, dr = np.ascontiguousarray(dx), np.ascontiguousarray(dr)
        arm = self._held_arms(x[None], r[None], ticks, dx[:, None], dr[:, None])
        return np.asarray(self.jvps(arm, threads=1, lanes=1, side=side)[0, 0, :, 0])

    def jvps(
        self, arms: Arms, threads: int | None, lanes: int | None, *, every: bool = False,
        side: int | None = None,
    ) -> Array:  # fmt: skip
        """Products of derivatives of ticks with columns, for many arms.

        Args:
            arms: Where they begin, and the columns.
            threads: Cores to use; None for all that the work is worth.
            lanes: Arms in a vector register; None for the widest there is.
            every: Whether to return columns after every tick, not only after the last.
            side: See ``Motion``.

        Returns:
            Columns of the states, shape (b, ticks, nx, k), or (b, 1, nx, k).

        Raises:
            SimulationDiverged: If a tick cannot be computed.
            NotDifferentiable: If a tick has no derivative.
        """
        if compiled := self.ticks.compiled.smooth_ticks:
            columns, unfinished, *_ = compiled.propagate(arms, threads, lanes, every=every)
            unfinished = self._unsmooth_arms(unfinished, arms.x, arms.tau, arms.ticks)
        else:
            check_lanes(lanes)
            columns, unfinished = arms.empty_columns(every), list(range(arms.count))
        for arm in unfinished:
            with named_in_errors(arm, arms.count):
                for k, after in enumerate(propagate_arm(self.ticks, arms, arm, side)):
                    columns[arm, k if every else 0] = after
        return columns

    def _unsmooth_arms(self, unfinished: list[int], x: Array, r: Array, ticks: int) -> list[int]:
        """The unfinished arms, and those with a kink, now or later."""
        nonsmooth = self.ticks.nonsmooth
        if self.ticks.compiled.event_free and nonsmooth.depends_on_states and ticks > 1:
            return list(range(len(x)))
        return sorted({*unfinished, *nonsmooth.arms_with_kinks(x, r)})

    @cached_property
    def python_tick(self) -> Linearize:
        """Derivatives of one tick for Python, see ``python_linearize``."""
        compiled = self.ticks.compiled.smooth_ticks
        if compiled is None or self._coarse_steps.is_watching or self._p_indices:
            return unanswered
        return python_linearize(compiled, self._plant, self._stepper.p, self._choice.dt)
