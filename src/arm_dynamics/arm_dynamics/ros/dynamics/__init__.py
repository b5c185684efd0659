# SPDX-License-Identifier: Apache-2.0
"""The services of the dynamics node, one function each, and the counts of their requests.

The most frequent services run in C, without the interpreter (``compiled_services``).

Depends on the core, the interfaces and ``common``; neither on the node nor on the controller.
"""

from arm_dynamics.ros.dynamics.answers import ANSWERS
from arm_dynamics.ros.dynamics.compiled_services import COMPILED, CompiledServices, code_of, native
from arm_dynamics.ros.dynamics.request_counts import RequestCounts

__all__ = ["ANSWERS", "COMPILED", "CompiledServices", "RequestCounts", "code_of", "native"]
