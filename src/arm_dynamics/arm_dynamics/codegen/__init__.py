# SPDX-License-Identifier: Apache-2.0
"""Code generation: from CasADi functions to compiled C, with a cache.

Depends on expressions and files, and on nothing specific to robots. Names are imported when they
are first used: listing the supported processors does not need CasADi.
"""

from typing import TYPE_CHECKING

from arm_dynamics.lazy import on_demand

if TYPE_CHECKING:
    from arm_dynamics.codegen.kernel import Call, Kernel, generate, operations

__all__ = ["Call", "Kernel", "generate", "operations"]
__getattr__, __dir__ = on_demand(__name__, __file__)
