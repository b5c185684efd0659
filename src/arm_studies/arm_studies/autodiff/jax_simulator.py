# SPDX-License-Identifier: Apache-2.0
"""The simulation as a function of JAX arrays, with its derivative: ``jit``, ``vmap``, ``grad``."""

from __future__ import annotations

from functools import cache, partial
from typing import TYPE_CHECKING, Any

from arm_dynamics.attributes import sealed
from arm_dynamics.exceptions import InvalidInput, missing
from arm_sim.simulation.simulator import Simulator
from arm_studies.autodiff.motion import Motion

if TYPE_CHECKING:
    import jax


@sealed
class JaxSimulator:
    """Steps and rollouts of a scene for JAX.

    They may be compiled, mapped and differentiated in reverse (``jax.jit``, ``jax.vmap``,
    ``jax.grad``); mapped axes become arms that are simulated side by side. The gradient is that of
    ``Simulator.rollout_gradient``: exact, in double precision. Enable ``jax_enable_x64`` for
    arrays in double precision; otherwise JAX rounds arguments and results to single precision.

    Args:
        simulator: The scene, the method, and the current values of its tunable quantities. The
            simulator must not be used while JAX computes with it.

    Raises:
        InvalidInput: If JAX is not installed.

    Example:
        >>> arm = JaxSimulator(Simulator("panda"))  # doctest: +SKIP
        >>> jax.grad(lambda tau: arm.rollout(x0, tau)[-1, 0])(tau)  # doctest: +SKIP
    """

    def __init__(self, simulator: Simulator) -> None:
        self._states, self._motion = _simulated(), Motion(simulator)

    def step(self, x: Any, tau: Any, parameters: dict[str, Any] | None = None) -> jax.Array:
        """State after one tick.

        Args:
            x: State (q, v, z), shape (…, nx).
            tau: Torques, held, shape (…, n).
            parameters: As for ``rollout``.

        Returns:
            State at the end of the tick, shape (…, nx).
        """
        import jax.numpy as jnp

        return self.rollout(x, jnp.expand_dims(tau, -2), parameters)[..., 1, :]

    def rollout(self, x0: Any, tau: Any, parameters: dict[str, Any] | None = None) -> jax.Array:
        """States at all ticks.

        Args:
            x0: Initial states (q, v, z), shape (…, nx).
            tau: Torques of each tick, shape (…, ticks, n).
            parameters: Tunable quantities by name, shape (…, size).

        Returns:
            States, the first included, shape (…, ticks + 1, nx); NaN from where an arm diverges.

        Raises:
            InvalidInput: If a shape or name is not allowed. Values are checked when JAX computes,
                and its exception has the message.
        """
        import jax.numpy as jnp

        tuned, kind = self._motion.parameters(parameters), jnp.result_type(float)
        arms = self._motion.arms(x0, tau, tuned)
        x0, tau = jnp.asarray(x0, kind), jnp.asarray(tau, kind)
        named = [jnp.asarray(part, kind) for part in tuned]
        parts = [jnp.broadcast_to(part, (*arms, part.shape[-1])) for part in named]
        p = jnp.concatenate([jnp.zeros((*arms, 0), kind), *parts], axis=-1)
        x0 = jnp.broadcast_to(x0, (*arms, x0.shape[-1]))
        tau = jnp.broadcast_to(tau, (*arms, *tau.shape[-2:]))
        return self._states(self._motion, x0, tau, p)


@cache
def _simulated() -> Any:
    """States by motion, x0, tau and p, with their derivative."""
    try:
        import jax
    except ModuleNotFoundError as error:
        raise InvalidInput(missing(error.name, "jax")) from None

    # Callbacks with more leading axes are one call with more arms.
    call = partial(jax.pure_callback, vmap_method="broadcast_all")

    @partial(jax.custom_vjp, nondiff_argnums=(0,))
    def states(motion: Motion, x0: jax.Array, tau: jax.Array, p: jax.Array) -> jax.Array:
        shape = (*x0.shape[:-1], tau.shape[-2] + 1, x0.shape[-1])
        return call(motion.states, jax.ShapeDtypeStruct(shape, x0.dtype), x0, tau, p)

    type Arrays = tuple[jax.Array, ...]

    def forward(motion: Motion, *arguments: jax.Array) -> tuple[jax.Array, Arrays]:
        return states(motion, *arguments), arguments

    def backward(motion: Motion, arguments: Arrays, g: jax.Array) -> Arrays:
        results = tuple(jax.ShapeDtypeStruct(each.shape, each.dtype) for each in arguments)
        return tuple(call(motion.pullback, results, *arguments, g))

    states.defvjp(forward, backward)
    return states
