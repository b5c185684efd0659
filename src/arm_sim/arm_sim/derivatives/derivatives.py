# SPDX-License-Identifier: Apache-2.0
"""Derivatives of a scene's ticks and rollouts, for users."""

from collections.abc import Sequence
from itertools import chain
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, real_array
from arm_dynamics.attributes import sealed
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_dynamics.exceptions import InvalidInput
from arm_sim.derivatives.gradient import Gradients, RolloutGradient, gradient_of, initial_slope
from arm_sim.derivatives.linearization import Linearizer
from arm_sim.derivatives.tangents import Arms
from arm_sim.inputs import check_row, check_rows, check_side, check_torque, check_whole
from arm_sim.integrators.selection import Choice
from arm_sim.plant.admissible_states import pack_state
from arm_sim.plant.plant import Plant
from arm_sim.state import State
from arm_sim.stepping.rollouts.batch import Batch, by_tick, states
from arm_sim.stepping.stepper import Stepper


@sealed
class Derivatives:
    """Exact derivatives of the ticks and rollouts of a scene; compiled at their first use.

    Tunable quantities have the values of the stepper where none are given.

    Args:
        plant: The scene's equations.
        choice: Method, tick and tolerance.
        stepper: Runs its ticks.
        backend: As for ``Kernel``.
    """

    def __init__(self, plant: Plant, choice: Choice, stepper: Stepper, backend: str) -> None:
        self._plant, self._choice, self._stepper, self._backend = plant, choice, stepper, backend
        self._linearizers = dict[tuple[int, ...], Linearizer]()

    def linearizer(self, p_indices: tuple[int, ...] = ()) -> Linearizer:
        """Derivatives of ticks, those by some entries of p included; kept for the next time.

        It takes arrays that are not checked: for other code of the suite.

        Args:
            p_indices: Indices in p.
        """
        if p_indices not in self._linearizers:
            self._linearizers[p_indices] = Linearizer(
                self._plant, self._choice, self._stepper, self._backend, p_indices
            )
        return self._linearizers[p_indices]

    @built_once
    def gradients(self) -> Gradients:
        """Gradients of functions of many arms' states, from arrays that are not checked."""
        all_entries = tuple(range(len(self._plant.parameters.nominal)))
        ticks = self.linearizer(all_entries).ticks
        return Gradients(self._plant, self._choice, ticks, self._backend)

    @overload
    def linearize(
        self, state: State, tau: ArrayLike, ticks: int = 1, *, side: int | None = None
    ) -> tuple[Array, Array]: ...

    @overload
    def linearize(
        self, state: State, tau: ArrayLike, ticks: int = 1, *, by: Sequence[str],
        side: int | None = None,
    ) -> tuple[Array, Array, dict[str, Array]]: ...  # fmt: skip

    def linearize(
        self, state: State, tau: ArrayLike, ticks: int = 1, *, by: Sequence[str] | None = None,
        side: int | None = None,
    ) -> tuple[Array, Array] | tuple[Array, Array, dict[str, Array]]:  # fmt: skip
        """Exact derivatives of the state after a tick (or several, torque held).

        Across events, which move with the state: see ``docs/concepts/derivatives.md``. Under error
        control the first tick chooses its sub-steps anew, as after a reset, whatever sub-step the
        simulator remembers: derivatives depend on the arguments alone.

        Args:
            state: State at the beginning of the tick.
            tau: Torque in [N m] or [N], or commands of the drives, shape (n,).
            ticks: Number of ticks.
            by: Names of tunable quantities to differentiate by as well, see
                ``Simulator.set_parameter``.
            side: For ticks without a derivative, 1 or -1: derivatives on the side where the entry
                that they are taken by is larger or smaller; None: such ticks are refused.

        Returns:
            A = ∂x⁺/∂x of shape (nx, nx) and B = ∂x⁺/∂τ of shape (nx, n), with x = (q, v, z); if
            quantities are named, also P with P[name] = ∂x⁺/∂p of shape (nx, size).

        Raises:
            InvalidInput: If an argument is not allowed.
            NotDifferentiable: If a tick has no derivative, on that side if one is chosen: a state
                on the boundary of a mode, a joint held between its sliding and its static level,
                a command at its limit, events at the same instant, a contact that is grazed.
            SimulationDiverged: If a tick cannot be computed.
        """
        # One call of C, which answers None where arguments have to be checked or the tick has an
        # event: all that follows is for these.
        if type(ticks) is int and ticks == 1 and by is None and side is None:
            slope = self.linearizer().python_tick(state, tau)
            if slope is not None:
                nx = self._plant.nx
                return slope[:, :nx], slope[:, nx:]
        x, command = self._point(state, tau, ticks)
        places = self._places(by)
        linearizer = self.linearizer(tuple(chain(*places.values())))
        slope = linearizer(x, command, ticks, check_side(side))
        return self._split(slope, by, places)

    def jvp(
        self, state: State, tau: ArrayLike, dx: ArrayLike, dtau: ArrayLike, ticks: int = 1, *,
        side: int | None = None,
    ) -> Array:  # fmt: skip
        """A dx + B dτ of ``linearize``: first-order change of the state after a tick.

        A and B are not formed where the tick is smooth.

        Args:
            state: State at the beginning of the tick.
            tau: Torque, as for ``linearize``.
            dx: Change of x = (q, v, z), shape (nx,).
            dtau: Change of the torque, shape (n,).
            ticks: Number of ticks.
            side: As for ``linearize``.

        Returns:
            Change of the state after the ticks, shape (nx,).

        Raises:
            InvalidInput: If an argument is not allowed.
            NotDifferentiable: As ``linearize``.
            SimulationDiverged: As ``linearize``.
        """
        x, command = self._point(state, tau, ticks)
        nx, n = self._plant.nx, self._plant.model.n
        dx, dtau = check_row("dx", dx, nx), check_row("dtau", dtau, n)
        return self.linearizer().jvp(x, command, ticks, dx, dtau, check_side(side))

    def vjp(
        self, state: State, tau: ArrayLike, weights: ArrayLike, ticks: int = 1, *,
        side: int | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Aᵀ w and Bᵀ w of ``linearize``: the gradient of w · x⁺ by the state and the torque.

        A and B are not formed where the tick is smooth.

        Args:
            state: State at the beginning of the tick.
            tau: Torque, as for ``linearize``.
            weights: w, shape (nx,).
            ticks: Number of ticks.
            side: As for ``linearize``.

        Returns:
            Gradients by x = (q, v, z), shape (nx,), and by the torque, shape (n,).

        Raises:
            InvalidInput: If an argument is not allowed.
            NotDifferentiable: As ``linearize``.
            SimulationDiverged: As ``linearize``.
        """
        x, command = self._point(state, tau, ticks)
        weights = check_row("weights", weights, self._plant.nx)
        gradients, p = self.gradients, self._stepper.p
        return gradients.product(x, command, p, ticks, weights, check_side(side))

    @overload
    def linearize_many(
        self, q: ArrayLike, v: ArrayLike, tau: ArrayLike, ticks: int = 1, *,
        side: int | None = None, threads: int | None = None, lanes: int | None = None,
    ) -> tuple[Array, Array]: ...  # fmt: skip

    @overload
    def linearize_many(
        self, q: ArrayLike, v: ArrayLike, tau: ArrayLike, ticks: int = 1, *, by: Sequence[str],
        side: int | None = None, threads: int | None = None, lanes: int | None = None,
    ) -> tuple[Array, Array, dict[str, Array]]: ...  # fmt: skip

    def linearize_many(
        self, q: ArrayLike, v: ArrayLike, tau: ArrayLike, ticks: int = 1, *,
        by: Sequence[str] | None = None, side: int | None = None, threads: int | None = None,
        lanes: int | None = None,
    ) -> tuple[Array, Array] | tuple[Array, Array, dict[str, Array]]:  # fmt: skip
        """Derivatives of ``linearize`` at many states on all cores, if smooth in vector registers.

        Args:
            q: Positions in [rad] or [m], shape (b, n).
            v: Velocities in [rad/s] or [m/s], shape (b, n).
            tau: Torques in [N m] or [N], held, shape (n,) or (b, n).
            ticks: Number of ticks.
            by: As for ``linearize``.
            side: As for ``linearize``.
            threads: Number of threads; None for all cores.
            lanes: Arms per vector register: 8, 4, 2 or 1; None for the widest available in smooth
                scenes, and for 1 in scenes with events, where compilation takes long.

        Returns:
            A of shape (b, nx, nx) and B of shape (b, nx, n); if parameters are named, also P with
            P[name] of shape (b, nx, size). Internal states z are those consistent with q and v, as
            after a reset.

        Raises:
            InvalidInput: If an argument is not allowed.
            NotDifferentiable: If a tick of an arm has no derivative; it names the arm.
            SimulationDiverged: If a tick of an arm cannot be computed; likewise.
        """
        check_whole("ticks", ticks, 1)
        x = states(self._plant, self._stepper.p, q, v, ("q", "v"))
        commands = by_tick("tau", tau, len(x), 1, self._plant.model.n)[:, 0]
        places = self._places(by)
        linearizer = self.linearizer(tuple(chain(*places.values())))
        side = check_side(side)
        slopes = linearizer.differentiate_arms(x, commands, ticks, threads, lanes, side)
        return self._split(slopes, by, places)

    def rollout_jvp(
        self, q0: ArrayLike, v0: ArrayLike, tau: ArrayLike, steps: int, dq0: ArrayLike,
        dv0: ArrayLike, dtau: ArrayLike, *, parameters: dict[str, Any] | None = None,
        side: int | None = None, threads: int | None = None, lanes: int | None = None,
    ) -> Array:  # fmt: skip
        """Directional derivative of the states of a rollout, with a direction for each arm.

        It is the product of the rollout's derivative with that direction; ``rollout_gradient`` is
        the product of its transpose with weights. Derivatives of ticks are formed at events only.

        Args:
            q0: As for ``Simulator.rollout``; with bilateral constraints, states that satisfy them.
            v0: As for ``Simulator.rollout``.
            tau: As for ``Simulator.rollout``; they act immediately.
            steps: Ticks to advance.
            dq0: Change of the initial positions, shape (b, n).
            dv0: Change of the initial velocities, shape (b, n).
            dtau: Change of the torques, shape (n,), (b, n) or (b, steps, n).
            parameters: As for ``Simulator.rollout``.
            side: As for ``linearize``, of each tick.
            threads: Number of threads; None for all cores.
            lanes: Arms per vector register: 8, 4, 2 or 1; None for the widest available.

        Returns:
            Changes of the states (q, v), shape (b, steps + 1, 2n).

        Raises:
            InvalidInput: If a shape or value is not allowed.
            NotDifferentiable: If a tick of an arm has no derivative; it names the arm.
            SimulationDiverged: If a tick of an arm cannot be computed; likewise.
        """
        plant = self._plant
        p = plant.parameters.merged(parameters or {}, self._stepper.p)
        batch = Batch.of(plant, q0, v0, tau, steps, p, last_only=True)
        count, ticks, n = len(batch.x0), batch.steps, plant.model.n
        dx0 = np.hstack([check_rows("dq0", dq0, count, n), check_rows("dv0", dv0, count, n)])
        if plant.nz:
            arms = zip(batch.x0, dx0, strict=True)
            dz0 = [initial_slope(plant, x[: 2 * n]) @ dx for x, dx in arms]
            dx0 = np.hstack([dx0, np.array(dz0)])
        initial = np.ascontiguousarray(dx0)[:, :, None]
        held = by_tick("dtau", dtau, count, ticks, n)[:, :ticks, :, None]
        columns = Arms(batch.x0, batch.tau[:, :ticks], batch.p, initial, held)
        side = check_side(side)
        changes = self.linearizer().jvps(columns, threads, lanes, every=True, side=side)
        return np.concatenate([initial[:, None], changes], axis=1)[..., : 2 * n, 0]

    def rollout_gradient(
        self, q0: ArrayLike, v0: ArrayLike, tau: ArrayLike, steps: int, g: ArrayLike, *,
        parameters: dict[str, Any] | None = None, side: int | None = None,
        threads: int | None = None, lanes: int | None = None,
    ) -> RolloutGradient:  # fmt: skip
        """Gradient of a function L of the states of a rollout, by all its arguments.

        It costs about as much as four rollouts. It stores the motion of the arms that are advanced
        side by side: threads × lanes × (steps + 1) × nx numbers, besides arguments and results;
        with events also their modes, and the derivatives of the ticks that have one; with error
        control, those of every tick of an arm.

        Args:
            q0: As for ``Simulator.rollout``; with bilateral constraints, states that satisfy them.
            v0: As for ``Simulator.rollout``.
            tau: As for ``Simulator.rollout``; they act immediately.
            steps: Ticks to advance.
            g: ∂L/∂states at the states that ``rollout`` returns, shape (b, steps + 1, 2n).
            parameters: As for ``Simulator.rollout``.
            side: As for ``linearize``, of each tick.
            threads: Number of threads; None for all cores.
            lanes: Arms per vector register: 8, 4, 2 or 1; None for the widest available.

        Raises:
            InvalidInput: If a shape or value is not allowed.
            NotDifferentiable: If a tick of an arm has no derivative; it names both.
            SimulationDiverged: If a tick of an arm cannot be computed; likewise.
        """
        p = self._plant.parameters.merged(parameters or {}, self._stepper.p)
        batch = Batch.of(self._plant, q0, v0, tau, steps, p, last_only=True)
        shape = len(batch.x0), batch.steps + 1, 2 * self._plant.model.n
        weights = np.ascontiguousarray(real_array("g", g))
        if weights.shape != shape or not np.isfinite(weights).all():
            raise InvalidInput(
                f"g has shape {weights.shape}; finite numbers of shape {shape} are expected"
            )
        if self._plant.nz:
            weights = np.pad(weights, ((0, 0), (0, 0), (0, self._plant.nz)))
        gradients = self.gradients.run(batch, weights, threads, lanes, check_side(side))
        return gradient_of(self._plant, batch, gradients, np.shape(tau))

    def _point(self, state: State, tau: ArrayLike, ticks: int) -> tuple[Array, Array]:
        """Point at which a tick is differentiated: x and the command, validated."""
        check_whole("ticks", ticks, 1)
        if not isinstance(state, State):
            kind = f"state is of type {type(state).__name__}"
            raise InvalidInput(f"{kind}; a State is expected, as of sim.state or sim.reset(q, v)")
        x = pack_state(self._plant, state.q, state.v, state.z)
        return x, np.array(check_torque(tau, self._plant.model.joint_names))

    def _places(self, by: Sequence[str] | None) -> dict[str, tuple[int, ...]]:
        """Indices in p of quantities to differentiate by; ``by`` may be a single name."""
        if by is None:
            return {}
        return self._plant.parameters.places((by,) if isinstance(by, str) else tuple(by))

    def _split(
        self, slope: Array, by: Sequence[str] | None, places: dict[str, tuple[int, ...]]
    ) -> tuple[Array, Array] | tuple[Array, Array, dict[str, Array]]:
        """Derivatives by state, torque and quantities, from all of them side by side."""
        sizes = self._plant.nx, self._plant.model.n, *map(len, places.values())
        A, B, *parts = np.split(slope, np.cumsum(sizes)[:-1], axis=-1)
        return (A, B) if by is None else (A, B, dict(zip(places, parts, strict=True)))
