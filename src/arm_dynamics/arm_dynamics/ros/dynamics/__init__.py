# SPDX-License-Identifier: Apache-2.0
"""The answers of the dynamics node's services, one function each, and the count of requests.

The most frequent requests are answered by C, without the interpreter (``compiled_services``).

Depends on the core, the interfaces and ``common``; neither on the node nor on the controller.
"""

from arm_dynamics.ros.dynamics.answers import ANSWERS
from arm_dynamics.ros.dynamics.compiled_services import COMPILED, CompiledServices, native
from arm_dynamics.ros.dynamics.request_counts import RequestCounts

__all__ = ["ANSWERS", "COMPILED", "CompiledServices", "RequestCounts", "native"]
