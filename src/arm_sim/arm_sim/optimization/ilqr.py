# SPDX-License-Identifier: Apache-2.0
"""iLQR on the simulator's own steps, with limits of commands.

Trajectories are improved by differential dynamic programming without second derivatives of the
steps: Li and Todorov, "Iterative linear quadratic regulator design for nonlinear biological
movement systems", ICINCO 2004. Limits hold in the backward pass (Tassa, Mansard and Todorov,
"Control-limited differential dynamic programming", ICRA 2014). All sizes of a step are tried at
once, each by an arm in a lane of a vector register.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array, real_array
from arm_sim.exceptions import NotDifferentiable, SimulationDiverged
from arm_sim.inputs import whole
from arm_sim.optimization.backward import Policy, backward, library_of
from arm_sim.optimization.cost import Cost
from arm_sim.optimization.forward import Course, Forward
from arm_sim.simulator import Simulator

SIZES: Final[Array] = np.array([0.5**k for k in range(8)])
"""Sizes of the step that are tried."""
FIRST, FACTOR, LEAST, MOST = 1e-2, 5.0, 1e-8, 1e8
"""Damping: where it begins, how it changes, below which it is zero, above which it is given up."""
# Within limits by more than rounding: at a limit itself a command has no derivative.
_INSIDE = 1.0 - 1e-9


@dataclass(frozen=True)
class Phase:
    """Nodes in which an arm has the same equations; what it carries may change between phases.

    Attributes:
        simulator: The arm. A node is a tick of it, with its tunable quantities as they are; its
            sensors and the delay of commands are not part of what is optimized.
        nodes: How many.
    """

    simulator: Simulator
    nodes: int


@dataclass(frozen=True)
class Trajectory:
    """A motion that obeys the equations, and what is known about improving it.

    Attributes:
        x: States (q, v, z), shape (nodes + 1, nx).
        u: Commands, as ``Simulator.step`` takes them, shape (nodes, n).
        cost: What it costs.
        feedback: K of u + K (x' - x), by which an arm comes back to it, shape (nodes, n, nx).
        costs: What it cost from the beginning, and after each improvement.
        damping: Of the next improvement.
        verdict: ``converged``, ``stuck`` (no step makes it better), or empty.
    """

    x: Array
    u: Array
    cost: float
    feedback: Array
    costs: tuple[float, ...] = ()
    damping: float = FIRST
    verdict: str = field(default="")


class ILQR:
    """Improves trajectories of an arm.

    Attributes:
        cost: What is to be small; after it is replaced, ``moved`` takes a trajectory up again.

    Args:
        phases: The arm, or several that differ in what they carry, one after the other.
        cost: What is to be small.
        low: Least commands, a number or shape (n,) or (nodes, n); None for the scene's limits.
        high: Largest commands, likewise.
        tolerance: Share of the cost that is not worth another improvement.
        threads: Cores for derivatives; None for all.

    Raises:
        InvalidInput: If the phases do not go together, or limits leave nothing.

    Example:
        >>> optimizer = ILQR([Phase(sim, 100)], cost)
        >>> best = optimizer.solve(sim.x, np.zeros((100, sim.n)))
    """

    def __init__(
        self,
        phases: Sequence[Phase],
        cost: Cost,
        *,
        low: ArrayLike | None = None,
        high: ArrayLike | None = None,
        tolerance: float = 1e-6,
        threads: int | None = None,
    ) -> None:
        self._phases, self.cost = tuple(phases), cost
        self._tolerance, self._threads = tolerance, threads
        _check(self._phases)
        self._forward = [Forward(phase.simulator) for phase in phases]
        ends = np.cumsum([0, *(phase.nodes for phase in phases)]).tolist()
        self._parts = [slice(a, b) for a, b in zip(ends, ends[1:], strict=False)]
        first = self._phases[0].simulator
        self._nx, self._n, self._nodes = first.plant.nx, first.n, ends[-1]
        own = [np.tile(p.simulator.model.command_limit, (p.nodes, 1)) for p in phases]
        limit = _INSIDE * np.vstack(own)
        self._low = np.maximum(-limit, self._rows("low", -np.inf if low is None else low))
        self._high = np.minimum(limit, self._rows("high", np.inf if high is None else high))
        if not (self._low <= self._high).all():
            raise InvalidInput("low is above high, or beyond the scene's limits")

    def start(self, x0: ArrayLike, u: ArrayLike) -> Trajectory:
        """Make the motion of a guess.

        Args:
            x0: The state at the beginning, such as ``Simulator.x``, shape (nx,).
            u: Commands, shape (nodes, n); cut at their limits.

        Raises:
            InvalidInput: If a shape or value is not allowed.
            SimulationDiverged: If the motion has no end.
        """
        given, commands = real_array("x0", x0), real_array("u", u)
        for name, array, shape in (
            ("x0", given, (self._nx,)),
            ("u", commands, (self._nodes, self._n)),
        ):
            if array.shape != shape or not np.isfinite(array).all():
                raise InvalidInput(
                    f"{name} has shape {array.shape}; finite numbers of {shape} are needed"
                )
        states, feedback = np.tile(given, (self._nodes + 1, 1)), (*commands.shape, self._nx)
        return self.moved(Trajectory(states, commands, np.inf, np.zeros(feedback)), given)

    def moved(self, old: Trajectory, x0: Array, du: Array | float = 0.0) -> Trajectory:
        """The motion from another initial state, which comes back to the old one by its feedback.

        Args:
            old: A trajectory.
            x0: State at the beginning, shape (nx,).
            du: What is added to commands, shape (nodes, n).

        Raises:
            SimulationDiverged: If that motion has no end.
        """
        policy = Policy(np.zeros(old.u.shape) + du, old.feedback, promised=0.0)
        made = self._step(replace(old, costs=()), policy, np.ones(1), x0)
        if made is None:
            raise SimulationDiverged("the motion diverges, or costs no finite number")
        return replace(made, damping=old.damping)

    def improve(self, old: Trajectory) -> Trajectory:
        """Make one iteration: derivatives, the best policy, and the best size of its step.

        Returns:
            A trajectory that costs less, or the same with a verdict.

        Raises:
            NotDifferentiable: If a node has no derivative.
            CompilerMissing: If there is no C compiler.
        """
        slopes, expansion = self._slopes(old), self.cost.expansion(old.x, old.u)
        low, high, damping = self._low - old.u, self._high - old.u, old.damping
        while damping <= MOST:
            policy = backward(slopes, expansion, low, high, damping)
            made = self._step(old, policy, SIZES) if policy else None
            if made is not None and made.cost < old.cost:
                less = damping / FACTOR if damping > LEAST else 0.0
                small = old.cost - made.cost <= self._tolerance * abs(old.cost)
                done = "converged" if small and damping <= FIRST else ""
                return replace(made, damping=less, verdict=done)
            if policy and -policy.promised <= self._tolerance * abs(old.cost) and damping <= FIRST:
                return replace(old, feedback=policy.K, verdict="converged")
            damping = max(FACTOR * damping, FIRST)
        return replace(old, verdict="stuck")

    def solve(
        self,
        x0: ArrayLike,
        u: ArrayLike,
        iterations: int = 100,
        told: Callable[[Trajectory], object] | None = None,
    ) -> Trajectory:
        """Improve a guess until that is not worth while.

        Args:
            x0: As for ``start``.
            u: As for ``start``.
            iterations: How many improvements at most.
            told: Called with the trajectory after each.

        Raises:
            InvalidInput: If an argument is not allowed.
            SimulationDiverged: If the motion of the guess has no end.
            NotDifferentiable: If a node has no derivative.
            CompilerMissing: If there is no C compiler.
        """
        whole("iterations", iterations, 0)
        best = self.start(x0, u)
        for _ in range(iterations):
            best = self.improve(best)
            if told is not None:
                told(best)
            if best.verdict:
                break
        return best

    def _slopes(self, at: Trajectory) -> Array:
        """A and B of all nodes side by side, shape (nodes, nx, nx + n)."""
        parts = []
        for phase, part in zip(self._phases, self._parts, strict=True):
            linearizer = phase.simulator.compiled.linearizer()
            try:
                parts.append(linearizer.many(at.x[part], at.u[part], 1, self._threads, None))
            except NotDifferentiable as error:
                raise NotDifferentiable(
                    f"the trajectory cannot be improved: {error} (arms are the nodes of a phase, "
                    f"here from node {part.start} on); allowed: motions that do not rest at stops "
                    "or stick, or scenes without stops and dry friction"
                ) from None
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _step(
        self, old: Trajectory, policy: Policy, sizes: Array, x0: Array | None = None
    ) -> Trajectory | None:
        """The best of the motions that a policy makes with steps of these sizes, if any."""
        x = np.empty((len(sizes), self._nodes + 1, self._nx))
        u = np.empty((len(sizes), self._nodes, self._n))
        x[:, 0] = old.x[0] if x0 is None else x0
        for forward, part in zip(self._forward, self._parts, strict=True):
            own = replace(policy, k=policy.k[part], K=policy.K[part])
            course = Course(old.x[part], old.u[part], own, self._low[part], self._high[part])
            forward.follow(course, sizes, x[:, part.start : part.stop + 1], u[:, part])
        with np.errstate(over="ignore", invalid="ignore"):
            values = np.asarray(self.cost.value(x, u))
        values = np.where(np.isfinite(values) & np.isfinite(x).all(axis=(1, 2)), values, np.inf)
        best = int(np.argmin(values))
        if not np.isfinite(values[best]):
            return None
        cost = float(values[best])
        return Trajectory(x[best], u[best], cost, policy.K, (*old.costs, cost))

    def _rows(self, name: str, limit: ArrayLike) -> Array:
        given = real_array(name, limit)
        if given.shape not in ((), (self._n,), (self._nodes, self._n)):
            raise InvalidInput(
                f"{name} has shape {given.shape}; allowed is a number, ({self._n},) or "
                f"({self._nodes}, {self._n})"
            )
        return np.broadcast_to(given, (self._nodes, self._n))


def prepare(simulator: Simulator) -> None:
    """Compile what ``ILQR`` needs of a simulator, unless that is done.

    Raises:
        CompilerMissing: If there is no C compiler.
    """
    simulator.compiled.linearizer().prepare()
    Forward(simulator).prepare()
    library_of(simulator.plant.nx, simulator.n)


def _check(phases: tuple[Phase, ...]) -> None:
    if not phases:
        raise InvalidInput("no phase is given; at least one is needed")
    for phase in phases:
        whole("nodes", phase.nodes, 1)
    sizes = [_size(phase.simulator) for phase in phases]
    if len(set(sizes)) > 1:
        raise InvalidInput(f"phases have states of {[size[0] for size in sizes]} numbers; arms of "
                           "the same joints and laws are needed")  # fmt: skip


def _size(simulator: Simulator) -> tuple[int, tuple[str, ...]]:
    return simulator.plant.nx, simulator.joint_names
