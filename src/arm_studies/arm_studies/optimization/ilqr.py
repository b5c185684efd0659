# SPDX-License-Identifier: Apache-2.0
"""iLQR with the simulator's own steps and with command limits.

Trajectories are improved by differential dynamic programming without second derivatives of the
steps: Li and Todorov, "Iterative linear quadratic regulator design for nonlinear biological
movement systems", ICINCO 2004. Limits are enforced in the backward pass (Tassa, Mansard and
Todorov, "Control-limited differential dynamic programming", ICRA 2014). Step sizes are tried at
once, each by an arm in a SIMD lane.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array, positive, real_array
from arm_dynamics.attributes import frozen, sealed
from arm_sim import NotDifferentiable, SimulationDiverged, Simulator
from arm_sim.inputs import check_whole
from arm_studies._renaming import renamed_argument
from arm_studies.optimization.backward import Policy, backward, library_of
from arm_studies.optimization.cost import Cost
from arm_studies.optimization.forward import Baseline, Forward

# Step sizes that are tried
STEP_SIZES: Final[Array] = np.array([0.5**k for k in range(8)])
# Regularization: initial value, factor, value below which it is zero, value above which to stop
DAMPING, FACTOR, LEAST_DAMPING, MOST_DAMPING = 1e-2, 5.0, 1e-8, 1e8
# Margin to limits beyond rounding: at a limit itself a command has no derivative.
_INSIDE = 1.0 - 1e-9


@frozen
class Phase:
    """Nodes with the same equations; the payload may change between phases.

    Attributes:
        simulator: The arm. A node is one of its ticks, with its current tunable quantities;
            sensors and command delays are not part of the optimization.
        nodes: Number of nodes.
    """

    simulator: Simulator
    nodes: int


@frozen
class Trajectory:
    """A feasible motion, and the state of its optimization.

    Attributes:
        x: States (q, v, z), shape (nodes + 1, nx).
        u: Commands, as for ``Simulator.step``, shape (nodes, n).
        cost: Its cost.
        feedback: Gains K of u + K (x' - x), which stabilize it, shape (nodes, n, nx).
        costs: Initial cost, and the cost after each iteration.
        damping: Regularization of the next iteration.
        verdict: ``converged``, ``stuck`` (no step reduces the cost), or empty.
    """

    x: Array
    u: Array
    cost: float
    feedback: Array
    costs: tuple[float, ...] = ()
    damping: float = DAMPING
    verdict: str = ""


@sealed
class ILQR:
    """Optimizes trajectories of an arm.

    Attributes:
        cost: Cost to be minimized; after replacing it, continue a trajectory by ``moved``.

    Args:
        phases: The arm, or several with different payloads, one after the other.
        cost: Cost to be minimized.
        low: Lower command limits, a number or shape (n,) or (nodes, n); None for the scene's.
        high: Upper command limits, likewise.
        tolerance: Relative reduction of the cost below which to stop.
        threads: Number of threads for derivatives; None for all cores.
        smoothing: With a speed in [rad/s] or [m/s], derivatives are those of an arm whose dry
            friction has the direction v / √(v² + smoothing²) and that has no stops; motions are
            those of the arm itself. With None they are those of its motion, in which a joint that
            friction holds does not respond to its command.

    Raises:
        InvalidInput: If the phases do not match, limits leave no admissible command, or
            ``smoothing`` is not positive, or given for an arm with contacts.

    Example:
        >>> optimizer = ILQR([Phase(sim, 100)], cost)
        >>> best = optimizer.solve(sim.arm.x, np.zeros((100, sim.n)))
    """

    cost: Cost  # may be replaced

    def __init__(
        self,
        phases: Iterable[Phase],
        cost: Cost,
        *,
        low: ArrayLike | None = None,
        high: ArrayLike | None = None,
        tolerance: float = 1e-6,
        threads: int | None = None,
        smoothing: float | None = None,
    ) -> None:
        self._phases, self.cost = tuple(phases), cost
        self._tolerance, self._threads = tolerance, threads
        if not self._phases:
            raise InvalidInput("there is no phase; at least one is expected")
        for phase in self._phases:
            check_whole("nodes", phase.nodes, 1)
        arms = [(p.simulator.joint_names, p.simulator.arm.plant.nx) for p in self._phases]
        if len(set(arms)) > 1:
            raise InvalidInput(
                f"phases have states of {[nx for _, nx in arms]} numbers; arms of the same joints "
                "and states are expected"
            )
        self._smoothing = None if smoothing is None else positive("smoothing", smoothing)
        if smoothing is not None and any(p.simulator.arm.plant.points for p in self._phases):
            raise InvalidInput(
                f"smoothing is {smoothing:g}, but the arm has contacts, which it leaves out; "
                "allowed: None"
            )
        self._forward = [Forward(phase.simulator) for phase in self._phases]
        self._eventful = any(forward.eventful for forward in self._forward)
        ends = np.cumsum([0, *(phase.nodes for phase in self._phases)]).tolist()
        self._parts = [slice(a, b) for a, b in zip(ends, ends[1:], strict=False)]
        first = self._phases[0].simulator
        self._nx, self._n, self._nodes = first.arm.plant.nx, first.n, ends[-1]
        own = [np.tile(p.simulator.model.standing_limit, (p.nodes, 1)) for p in self._phases]
        limit = _INSIDE * np.vstack(own)
        self._low = np.maximum(-limit, self._rows("low", -np.inf if low is None else low))
        self._high = np.minimum(limit, self._rows("high", np.inf if high is None else high))
        if not (self._low <= self._high).all():
            raise InvalidInput("low is above high, or beyond the scene's limits")

    def start(self, x0: ArrayLike, u: ArrayLike) -> Trajectory:
        """Simulate an initial guess.

        Args:
            x0: Initial state, such as ``SimulatedArm.x``, shape (nx,).
            u: Commands, shape (nodes, n); clipped to their limits.

        Raises:
            InvalidInput: If a shape or value is not allowed.
            SimulationDiverged: If the motion diverges.
        """
        initial, commands = real_array("x0", x0), real_array("u", u)
        expected = ("x0", initial, (self._nx,)), ("u", commands, (self._nodes, self._n))
        for name, array, shape in expected:
            if array.shape != shape or not np.isfinite(array).all():
                raise InvalidInput(
                    f"{name} has shape {array.shape}; finite numbers of {shape} are expected"
                )
        states, feedback = np.tile(initial, (self._nodes + 1, 1)), (*commands.shape, self._nx)
        return self.moved(Trajectory(states, commands, np.inf, np.zeros(feedback)), initial)

    def moved(self, old: Trajectory, x0: Array, du: Array | float = 0.0) -> Trajectory:
        """The motion from another initial state, which tracks the old one by its feedback.

        Args:
            old: A trajectory.
            x0: Initial state, shape (nx,).
            du: Offsets of the commands, shape (nodes, n).

        Raises:
            SimulationDiverged: If that motion diverges.
        """
        policy = Policy(np.zeros(old.u.shape) + du, old.feedback, change=0.0)
        trajectory = self._step(replace(old, costs=()), policy, np.ones(1), x0)
        if trajectory is None:
            raise SimulationDiverged("the motion diverges, or its cost is not finite")
        return replace(trajectory, damping=old.damping)

    def improve(self, old: Trajectory) -> Trajectory:
        """Perform one iteration: derivatives, backward pass, and line search.

        Returns:
            A trajectory of lower cost, or the same with a verdict.

        Raises:
            NotDifferentiable: If a node is not differentiable.
            CompilerMissing: If there is no C compiler.
        """
        slopes, expansion = self._slopes(old), self.cost.expansion(old.x, old.u)
        low, high, damping = self._low - old.u, self._high - old.u, old.damping
        while damping <= MOST_DAMPING:
            policy = backward(slopes, expansion, low, high, damping)
            better = self._line_search(old, policy) if policy else None
            if better is not None:
                less = damping / FACTOR if damping > LEAST_DAMPING else 0.0
                small = old.cost - better.cost <= self._tolerance * abs(old.cost)
                verdict = "converged" if small and damping <= DAMPING else ""
                return replace(better, damping=less, verdict=verdict)
            if policy and -policy.change <= self._tolerance * abs(old.cost) and damping <= DAMPING:
                return replace(old, feedback=policy.K, verdict="converged")
            damping = max(FACTOR * damping, DAMPING)
        return replace(old, verdict="stuck")

    @renamed_argument("told", "on_progress")
    def solve(
        self,
        x0: ArrayLike,
        u: ArrayLike,
        iterations: int = 100,
        on_progress: Callable[[Trajectory], object] | None = None,
    ) -> Trajectory:
        """Optimize from an initial guess until convergence.

        Args:
            x0: As for ``start``.
            u: As for ``start``.
            iterations: Largest number of iterations.
            on_progress: Called with the trajectory after each iteration.

        Raises:
            InvalidInput: If an argument is not allowed.
            SimulationDiverged: If the motion of the guess diverges.
            NotDifferentiable: If a node is not differentiable.
            CompilerMissing: If there is no C compiler.
        """
        check_whole("iterations", iterations, 0)
        best = self.start(x0, u)
        for _ in range(iterations):
            best = self.improve(best)
            if on_progress is not None:
                on_progress(best)
            if best.verdict:
                break
        return best

    def _slopes(self, at: Trajectory) -> Array:
        """A and B of all nodes side by side, shape (nodes, nx, nx + n)."""
        parts = []
        for phase, part in zip(self._phases, self._parts, strict=True):
            linearizer = phase.simulator.arm.compiled.derivatives.linearizer()
            x, u, width, threads = at.x[part], at.u[part], self._smoothing, self._threads
            try:
                parts.append(
                    linearizer.jacobians_along(x, u, threads) if width is None
                    else linearizer.smoothed_jacobians(x, u, width, threads)
                )  # fmt: skip
            except NotDifferentiable as error:
                raise NotDifferentiable(
                    f"the trajectory cannot be improved: {error} (arms are the nodes of a phase, "
                    f"here from node {part.start} on); allowed: another guess, or smoothing"
                ) from None
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _line_search(self, old: Trajectory, policy: Policy) -> Trajectory | None:
        """The best motion of a policy, of the first step sizes with a better one; else None."""
        count = 1 if self._eventful else len(STEP_SIZES)  # lanes save nothing with events
        for first in range(0, len(STEP_SIZES), count):
            trial = self._step(old, policy, STEP_SIZES[first : first + count])
            if trial is not None and trial.cost < old.cost:
                return trial
        return None

    def _step(
        self, old: Trajectory, policy: Policy, sizes: Array, x0: Array | None = None
    ) -> Trajectory | None:
        """The best motion of a policy over these step sizes; None if all of them diverge."""
        x = np.empty((len(sizes), self._nodes + 1, self._nx))
        u = np.empty((len(sizes), self._nodes, self._n))
        x[:, 0] = old.x[0] if x0 is None else x0
        for forward, part in zip(self._forward, self._parts, strict=True):
            own = replace(policy, k=policy.k[part], K=policy.K[part])
            baseline = Baseline(old.x[part], old.u[part], own, self._low[part], self._high[part])
            forward.follow(baseline, sizes, x[:, part.start : part.stop + 1], u[:, part])
        with np.errstate(over="ignore", invalid="ignore"):
            values = np.asarray(self.cost.value(x, u))
        values = np.where(np.isfinite(values) & np.isfinite(x).all(axis=(1, 2)), values, np.inf)
        best = int(np.argmin(values))
        if not np.isfinite(values[best]):
            return None
        cost = float(values[best])
        return Trajectory(x[best], u[best], cost, policy.K, (*old.costs, cost))

    def _rows(self, name: str, limit: ArrayLike) -> Array:
        rows = real_array(name, limit)
        if rows.shape not in ((), (self._n,), (self._nodes, self._n)):
            raise InvalidInput(
                f"{name} has shape {rows.shape}; allowed: a number, ({self._n},) or "
                f"({self._nodes}, {self._n})"
            )
        return np.broadcast_to(rows, (self._nodes, self._n))


def prepare(simulator: Simulator) -> None:
    """Compile what ``ILQR`` needs of a simulator, unless that is done.

    Raises:
        CompilerMissing: If there is no C compiler.
    """
    simulator.arm.compiled.derivatives.linearizer().prepare()
    Forward(simulator).prepare()
    library_of.cache_clear()  # what this process has loaded may not be in the folder to build into
    library_of(simulator.arm.plant.nx, simulator.n)
