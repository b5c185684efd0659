# SPDX-License-Identifier: Apache-2.0
"""The simulation as a function of PyTorch tensors, with its derivative."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed
from arm_dynamics.exceptions import InvalidInput
from arm_sim.simulation.simulator import Simulator
from arm_studies.autodiff.motion import Motion

if TYPE_CHECKING:
    import torch


@sealed
class TorchSimulator:
    """Steps and rollouts of a scene for PyTorch.

    ``backward`` computes the gradient of ``Simulator.rollout_gradient``: exact, in double
    precision. Tensors are copied to the processor and results to the device and type of ``x0``,
    or PyTorch's default type if ``x0`` has whole numbers.

    Args:
        simulator: The scene, the method, and the current values of its tunable quantities. The
            simulator must not be used by another thread while PyTorch computes with it.

    Raises:
        InvalidInput: If PyTorch is not installed.

    Example:
        >>> arm = TorchSimulator(Simulator("panda"))  # doctest: +SKIP
        >>> arm.rollout(x0, tau)[-1, 0].backward()  # doctest: +SKIP
    """

    def __init__(self, simulator: Simulator) -> None:
        self._states, self._motion = _simulated(), Motion(simulator)

    def step(self, x: Any, tau: Any, parameters: dict[str, Any] | None = None) -> torch.Tensor:
        """State after one tick.

        Args:
            x: State (q, v, z), shape (…, nx).
            tau: Torques, held, shape (…, n).
            parameters: As for ``rollout``.

        Returns:
            State at the end of the tick, shape (…, nx).
        """
        import torch

        return self.rollout(x, torch.as_tensor(tau).unsqueeze(-2), parameters)[..., 1, :]

    def rollout(self, x0: Any, tau: Any, parameters: dict[str, Any] | None = None) -> torch.Tensor:
        """States at all ticks.

        Args:
            x0: Initial states (q, v, z), shape (…, nx).
            tau: Torques of each tick, shape (…, ticks, n).
            parameters: Tunable quantities by name, shape (…, size).

        Returns:
            States, the first included, shape (…, ticks + 1, nx); NaN from where an arm diverges.

        Raises:
            InvalidInput: If a shape, name or number is not allowed.
        """
        import torch

        tuned = self._motion.parameters(parameters)
        arms = self._motion.arms(x0, tau, tuned)
        x0 = torch.as_tensor(x0)
        x0 = x0 if x0.is_floating_point() else x0.to(torch.get_default_dtype())
        like = {"dtype": x0.dtype, "device": x0.device}
        tau = torch.as_tensor(tau, **like)
        named = [torch.as_tensor(part, **like) for part in tuned]
        parts = [part.expand(*arms, part.shape[-1]) for part in named]
        p = torch.cat([torch.zeros((*arms, 0), **like), *parts], dim=-1)
        x0, tau = x0.expand(*arms, x0.shape[-1]), tau.expand(*arms, *tau.shape[-2:])
        states: torch.Tensor = self._states.apply(self._motion, x0, tau, p)
        return states


@cache
def _simulated() -> Any:
    """States by motion, x0, tau and p, with their derivative."""
    try:
        import torch
    except ModuleNotFoundError as error:
        raise InvalidInput(
            f"Python cannot find the module '{error.name}': install PyTorch as "
            "https://pytorch.org/get-started says"
        ) from None

    class States(torch.autograd.Function):  # type: ignore[misc]
        @staticmethod
        def forward(ctx: Any, motion: Motion, *arguments: torch.Tensor) -> torch.Tensor:
            ctx.motion = motion
            ctx.save_for_backward(*arguments)
            return _tensor(motion.states(*map(_array, arguments)), arguments[0])

        @staticmethod
        @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
        def backward(ctx: Any, g: torch.Tensor) -> tuple[torch.Tensor | None, ...]:
            arguments = ctx.saved_tensors
            gradients = ctx.motion.pullback(*map(_array, arguments), _array(g))
            return None, *(_tensor(gradient, arguments[0]) for gradient in gradients)

    return States


def _array(tensor: torch.Tensor) -> Any:
    """In double precision, since NumPy lacks some types of PyTorch."""
    return tensor.detach().cpu().double().numpy()


def _tensor(values: Array, like: torch.Tensor) -> torch.Tensor:
    import torch

    return torch.from_numpy(values).to(like.device, like.dtype)
