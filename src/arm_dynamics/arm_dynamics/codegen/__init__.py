# SPDX-License-Identifier: Apache-2.0
"""From CasADi functions to code that runs: C, a compiler, a cache of what it made.

Knows expressions and files, and nothing of robots.
"""

from arm_dynamics.codegen.kernel import Call, Kernel, generate, operations

__all__ = ["Call", "Kernel", "generate", "operations"]
