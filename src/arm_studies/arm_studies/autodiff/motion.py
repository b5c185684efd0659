# SPDX-License-Identifier: Apache-2.0
"""Motions of many arms as a function of arrays, with its transposed derivative, for NumPy."""

from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput
from arm_sim.plant.admissible_states import clip_to_stops
from arm_sim.simulation.simulator import Simulator
from arm_sim.stepping.rollouts.batch import Batch

# The libraries call from threads of their own; each call takes all cores.
_ONE_AT_A_TIME = Lock()


class Motion:
    """States of arms as a function f of their initial state, torques and parameters.

    Arrays have any number of leading axes, the same for all: one arm for each of their entries.
    Commands act at once, and a simulator's own state does not change. Torques beyond their limits
    are clipped.

    Attributes:
        nx: Length of x = (q, v, z).
        n: Degrees of freedom.

    Args:
        simulator: The scene, the method and the values of what is not varied.
    """

    def __init__(self, simulator: Simulator) -> None:
        if not isinstance(simulator, Simulator):
            raise InvalidInput(
                f"simulator = {simulator!r}; a Simulator is expected, such as Simulator('panda')"
            )
        self._compiled, self._tunable = simulator.arm.compiled, simulator.arm.plant.parameters
        self.nx, self.n = simulator.arm.plant.nx, simulator.n
        self._p = simulator.arm.parameters[: len(self._tunable.nominal)]

    def parameters(self, values: dict[str, Any] | None) -> list[Any]:
        """Values of all tunable quantities in order: these, of shape (…, size), or current ones.

        Raises:
            InvalidInput: If a name is not tunable or a size is not allowed.
        """
        by_name, parameters = values or {}, []
        for name in by_name:
            if name not in self._tunable.names:
                raise InvalidInput(
                    f"'{name}' is not tunable; the scene's 'tunable' names "
                    f"{self._tunable.names or 'nothing'}"
                )
        for item in self._tunable.items:
            current = self._tunable.of(item.name, self._p)
            value = by_name.get(item.name, current)
            if np.shape(value)[-1:] != current.shape:
                raise InvalidInput(
                    f"{item.name} has shape {tuple(np.shape(value))}; expected (…, {current.size})"
                )
            parameters.append(value)
        return parameters

    def arms(self, x0: Any, tau: Any, parameters: list[Any]) -> tuple[int, ...]:
        """Leading axes to which all arguments are broadcast.

        Args:
            x0: Initial states.
            tau: Torques of each tick.
            parameters: Results of ``parameters``.

        Raises:
            InvalidInput: If x0 and tau are not (…, nx) and (…, ticks, n) with at least one tick,
                or the leading axes cannot be broadcast.
        """
        if np.shape(x0)[-1:] != (self.nx,):
            raise InvalidInput(f"x0 has shape {tuple(np.shape(x0))}; expected (…, {self.nx})")
        shape = tuple(np.shape(tau))
        if len(shape) < 2 or shape[-1] != self.n or not shape[-2]:
            raise InvalidInput(
                f"tau has shape {shape}; expected (…, steps, {self.n}), at least one step"
            )
        leading = [np.shape(x0)[:-1], shape[:-2], *(np.shape(part)[:-1] for part in parameters)]
        try:
            return np.broadcast_shapes(*leading)
        except ValueError:
            raise InvalidInput(
                f"leading axes of x0, tau and parameters are {', '.join(map(str, leading))}; "
                "expected ones that can be broadcast"
            ) from None

    def states(self, x0: ArrayLike, tau: ArrayLike, p: ArrayLike) -> Array:
        """States at all ticks.

        Args:
            x0: Initial states (q, v, z), shape (…, nx).
            tau: Torques of each tick, shape (…, ticks, n).
            p: Tunable numbers, shape (…, np).

        Returns:
            The first state and those after each tick, shape (…, ticks + 1, nx), in the type of
            ``x0``; NaN from where an arm diverges.

        Raises:
            InvalidInput: If a number is not finite or not allowed.
        """
        batch = self._batch(x0, tau, p)
        with _ONE_AT_A_TIME:
            self._compiled.rollouts.run(batch, None, None)
        states = batch.out.reshape(*np.shape(tau)[:-2], *batch.out.shape[1:])
        return states.astype(np.asarray(x0).dtype, copy=False)

    def pullback(
        self, x0: ArrayLike, tau: ArrayLike, p: ArrayLike, g: ArrayLike
    ) -> tuple[Array, Array, Array]:
        """Gradients of Σ g · states by x0, tau and p, in their shapes and types.

        Args:
            x0: As for ``states``; with bilateral constraints, states that satisfy them.
            tau: As for ``states``.
            p: As for ``states``.
            g: Weights of the states, shape (…, ticks + 1, nx).

        Raises:
            InvalidInput: If a number is not finite or not allowed.
            NotDifferentiable: If a tick of an arm has no derivative.
            SimulationDiverged: If a tick of an arm cannot be computed.
        """
        batch = self._batch(x0, tau, p)
        weights = np.ascontiguousarray(_numbers("g", g).reshape(batch.out.shape))
        with _ONE_AT_A_TIME:
            gradients = self._compiled.derivatives.gradients.run(batch, weights, None, None)
        x, u, par = (
            by.reshape(np.shape(of)).astype(np.asarray(of).dtype, copy=False)
            for by, of in ((gradients.by_x, x0), (gradients.by_tau, tau), (gradients.by_p, p))
        )
        return x, u, par

    def _batch(self, x0: ArrayLike, tau: ArrayLike, p: ArrayLike) -> Batch:
        ticks, plant = np.shape(tau)[-2], self._compiled.plant
        x, u = _numbers("x0", x0).reshape(-1, self.nx), _numbers("tau", tau)
        rows = _numbers("parameters", p).reshape(len(x), -1)
        ends = np.cumsum([item.nominal.size for item in self._tunable.items])[:-1]
        parts = np.split(rows, ends, axis=1) if self._tunable.items else []
        self._tunable.merged(dict(zip(self._tunable.names, parts, strict=True)), self._p)
        if plant.model.stops:
            x = x.copy()
            for arm, row in enumerate(x):
                row[: self.n] = clip_to_stops(plant, row[: self.n], f"arm {arm}: ")
        out = np.empty((len(x), ticks + 1, self.nx))
        return Batch(x, u.reshape(len(x), ticks, self.n), rows, ticks, out)


def _numbers(name: str, values: ArrayLike) -> Array:
    array = np.ascontiguousarray(values, dtype=float)
    if not np.isfinite(array).all():
        raise InvalidInput(f"{name} has values that are not finite; finite ones are expected")
    return array
