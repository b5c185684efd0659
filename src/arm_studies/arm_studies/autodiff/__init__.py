# SPDX-License-Identifier: Apache-2.0
"""The simulation as a differentiable function of JAX and of PyTorch.

Knows the simulator; each library is imported when an object of its class is made. Public are
``JaxSimulator`` and ``TorchSimulator``.
"""

from arm_studies.autodiff.jax_simulator import JaxSimulator
from arm_studies.autodiff.torch_simulator import TorchSimulator

__all__ = ["JaxSimulator", "TorchSimulator"]
