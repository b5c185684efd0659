# SPDX-License-Identifier: Apache-2.0
"""Products with the derivative of a rollout and with its transpose, which are never formed.

The transpose gives gradients of functions of the states, by initial state, torques and parameters.
The motion is computed once and stored at the ticks, then λ = ∂L/∂x is propagated backwards tick by
tick by the transposed derivative of the same step (``integrators.adjoints``). That costs about as
much as four rollouts, for any number of torques. Ticks with events use their derivatives A, B, P.
"""

import ctypes
from functools import cache, partial

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen, sealed
from arm_dynamics.codegen.addresses import address, repeated
from arm_dynamics.codegen.kernel import operations
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_sim.derivatives.event_free_gradient import (
    EventFreeGradients,
    MotionPart,
    TickPart,
    adjoint_tick_functions,
)
from arm_sim.derivatives.motion import Motion, named_in_errors
from arm_sim.derivatives.tangents import MAX_OPERATIONS
from arm_sim.derivatives.tick_derivatives import TickDerivatives
from arm_sim.integrators.selection import Choice
from arm_sim.integrators.steps import build_tick
from arm_sim.plant.actuation import actuation
from arm_sim.plant.parameters import Parameters
from arm_sim.plant.plant import Plant
from arm_sim.stepping.arm_table import ArmTable, RolloutFlags
from arm_sim.stepping.engine import Compiled
from arm_sim.stepping.rollouts.batch import Batch
from arm_sim.stepping.rollouts.equal_steps import takes_equal_steps
from arm_sim.stepping.rollouts.lane_widths import widest
from arm_sim.stepping.rollouts.lanes import (
    ADDRESS,
    NUMBER,
    compile_lanes,
    lanes_source,
)
from arm_sim.stepping.rollouts.threads import share


@frozen
class RolloutGradient:
    """Gradient of a function L of a rollout's states; shapes are those of the arguments.

    Attributes:
        q0: ∂L/∂q0, shape (b, n).
        v0: ∂L/∂v0, shape (b, n).
        tau: ∂L/∂τ; for shared torques, the sum over arms or ticks.
    """

    q0: Array
    v0: Array
    tau: Array
    _by_p: Array
    _parameters: Parameters

    @property
    def parameters(self) -> dict[str, Array]:
        """∂L/∂p of every tunable quantity by its name, a row for each arm, shape (b, size)."""
        by_p = self._by_p.T
        return {name: self._parameters.of(name, by_p).T for name in self._parameters.names}


@frozen
class ArgumentGradients:
    """Gradients of a batch by initial states, torques and parameters.

    Attributes:
        by_x: Gradients by initial states (q, v, z), shape (b, nx).
        by_tau: Gradients by the torques of all ticks, shape (b, ticks, n).
        by_p: Gradients by parameters, shape (b, np).
    """

    by_x: Array
    by_tau: Array
    by_p: Array


def gradient_of(
    plant: Plant, batch: Batch, gradients: ArgumentGradients, shape: tuple[int, ...]
) -> RolloutGradient:
    """Gradients by the arguments of a rollout, from those by initial states and all torques.

    Args:
        plant: The scene's equations.
        batch: The arms.
        gradients: Gradients by initial states and all torques.
        shape: Shape of the torques in the arguments.
    """
    n, by_x = plant.model.n, gradients.by_x
    by_start = by_x[:, : 2 * n].copy()
    if plant.nz:
        for arm, x in enumerate(batch.x0):
            by_start[arm] += by_x[arm, 2 * n :] @ initial_slope(plant, x[: 2 * n])
    by_tau, by_p = gradients.by_tau, gradients.by_p
    if len(shape) < 3:
        by_tau = by_tau.sum(axis=1)
    if len(shape) == 1:
        by_tau = by_tau.sum(axis=0)
    return RolloutGradient(by_start[:, :n], by_start[:, n:], by_tau, by_p, plant.parameters)


def initial_slope(plant: Plant, x: Array) -> Array:
    """Derivative of the initial internal states by (q, v), shape (nz, 2n).

    These states are those at rest and nearly linear: fourth-order differences are accurate.
    """
    n, h = plant.model.n, 2.0**-10

    def z(qv: Array) -> Array:
        return plant.laws.initial(qv[:n], qv[n:])

    columns = [
        (8.0 * (z(x + e) - z(x - e)) - (z(x + 2 * e) - z(x - 2 * e))) / (12.0 * h)
        for e in h * np.eye(2 * n)
    ]
    return np.column_stack(columns)


@sealed
class Gradients:
    """Gradients of the rollouts of one scene.

    Args:
        plant: The scene's equations.
        choice: Method, tick and tolerance.
        ticks: Derivatives of ticks that have events, by all of p too.
        backend: As for ``Kernel``.
    """

    def __init__(self, plant: Plant, choice: Choice, ticks: TickDerivatives, backend: str) -> None:
        self._plant, self._choice, self._ticks = plant, choice, ticks
        self._free_plant, self._backend = plant.free or plant, backend
        self._code_of_width = cache(self._build_code)

    def run(
        self, batch: Batch, g: Array, threads: int | None, lanes: int | None,
        side: int | None = None,
    ) -> ArgumentGradients:  # fmt: skip
        """Gradients of Σ g · states for a batch, see ``Simulator.rollout_gradient``.

        Args:
            batch: The arms; ``out`` is not used.
            g: Gradients by the states, shape (b, steps + 1, nx).
            threads: Cores to use; None for all that the work is worth.
            lanes: Arms in a vector register; None for the widest there is.
            side: See ``Motion``.

        Raises:
            NotDifferentiable: If a tick has no derivative; it names arm and tick.
            SimulationDiverged: If a tick cannot be computed; likewise.
        """
        arms, ticks, n = len(batch.x0), batch.steps, self._plant.model.n
        shapes = batch.x0.shape, (arms, ticks, n), batch.p.shape
        gradients = ArgumentGradients(*map(np.zeros, shapes))
        code, width = widest(lanes, self._code_of_width)
        eventful = list(range(arms))
        if code is not None:
            eventful = self._run_in_lanes(code, width, batch, g, gradients, threads)
            kinks = self._ticks.nonsmooth.arms_with_kinks(batch.x0, batch.tau[:, : batch.steps])
            eventful = sorted({*eventful, *kinks})
        for arm in eventful:
            self._run_arm(batch, g, gradients, arm, side)
        return gradients

    def prepare(self) -> None:
        """Compile what motions need, unless that is done."""
        if widest(None, self._code_of_width)[0] is None:
            _ = self._event_free
        self._ticks.prepare_events()

    def product(
        self, x: Array, r: Array, p: Array, ticks: int, weights: Array, side: int | None = None
    ) -> tuple[Array, Array]:
        """Gradients of weights · state after ticks of one arm, by state and held command.

        Args:
            x: State, shape (nx,).
            r: Command, shape (n,).
            p: Tunable numbers, shape (np,).
            ticks: Number of ticks.
            weights: Shape (nx,).
            side: See ``Motion``.

        Raises:
            NotDifferentiable: If a tick has no derivative.
            SimulationDiverged: If a tick cannot be computed.
        """
        commands = repeated(r[None, None], (1, ticks, len(r)))
        batch = Batch(x[None], commands, p[None], ticks, np.empty((1, len(x))))
        g = np.zeros((1, ticks + 1, len(x)))
        g[0, -1] = weights
        gradients = self.run(batch, g, threads=1, lanes=1, side=side)
        return gradients.by_x[0], gradients.by_tau[0].sum(axis=0)

    def _run_in_lanes(
        self, code: Compiled, width: int, batch: Batch, g: Array,
        gradients: ArgumentGradients, threads: int | None,
    ) -> list[int]:  # fmt: skip
        """Fill in gradients of all arms, and return those that meet stops or diverge."""
        flags, tau = RolloutFlags(len(batch.x0)), batch.tau[:, : batch.steps]
        arms = ArmTable.of(batch.x0, tau, batch.p, self._choice.dt, flags, None)

        def work(first: int, last: int) -> None:
            motion = np.empty((batch.steps, batch.x0.shape[1], width))
            code.engine.rollout_gradient(
                code.scene, ctypes.byref(arms), first, last, address(g), address(motion),
                address(gradients.by_x), address(gradients.by_tau), address(gradients.by_p),
            )  # fmt: skip

        share(len(batch.x0), width, threads, work, batch.steps, flags.halt)
        return flags.marked(0, len(batch.x0))

    def _run_arm(
        self, batch: Batch, g: Array, gradients: ArgumentGradients, arm: int, side: int | None
    ) -> None:
        """Fill in the gradient of one arm; ticks with events are passed by their derivatives."""
        by_tau, by_p = gradients.by_tau[arm], gradients.by_p[arm]
        motion = Motion(self._ticks, batch.x0[arm], batch.p[arm], side)
        tau, parts = np.ascontiguousarray(batch.tau[arm, : batch.steps]), list[MotionPart]()
        while motion.ticks < batch.steps:
            if self._event_free and (stretch := self._event_free.advance(motion, tau)):
                parts.append(stretch)
            if (tick := motion.ticks) < batch.steps:
                with named_in_errors(arm, len(batch.x0), tick):
                    parts.append(TickPart(tick, motion.differentiate_tick(tau[tick])))
        weight, by_p[:] = g[arm, -1].copy(), 0.0
        for part in reversed(parts):
            weight = part.pull_back(weight, tau, g[arm], by_tau, by_p)
        gradients.by_x[arm] = weight

    @built_once
    def _event_free(self) -> EventFreeGradients | None:
        """Gradients through ticks without events of a scene with events."""
        engine, nonsmooth = self._ticks.compiled.engine, self._ticks.nonsmooth
        if not engine or self._backend == "vm":
            return None
        return EventFreeGradients.build(nonsmooth, engine, self._plant, self._choice)

    def _build_code(self, width: int) -> Compiled | None:
        in_lanes = self._backend != "vm" and takes_equal_steps(self._plant, self._choice)
        if not in_lanes or operations(self._functions[1]) > MAX_OPERATIONS:
            return None
        types = [ADDRESS, NUMBER, NUMBER, *[ADDRESS] * 5]
        write = partial(lanes_source, self._free_plant, self._choice, self._functions)
        return compile_lanes(write, width, "rollout_gradient", types)

    @built_once
    def _functions(self) -> tuple[ca.Function, ...]:
        act = actuation(self._free_plant)
        step, adjoint, *limits = adjoint_tick_functions(self._free_plant, self._choice)
        return build_tick(step, act), adjoint, *limits
