# SPDX-License-Identifier: Apache-2.0
"""Studies with robot arms: identification, sweeps, trajectory optimization, differentiation.

Depends on ``arm_dynamics`` and ``arm_sim``, which know nothing of it; no node needs it.
"""

__version__ = "0.1.0"
