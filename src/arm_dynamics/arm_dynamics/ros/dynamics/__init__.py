# SPDX-License-Identifier: Apache-2.0
"""The answers of the dynamics node's services, one function each, and the count of requests.

What is asked most is answered by C, without the interpreter (``compiled_services``).

It knows the core, the interfaces and ``common``; it knows neither the node nor the controller.
"""

from arm_dynamics.ros.dynamics.answers import ANSWERS
from arm_dynamics.ros.dynamics.compiled_services import COMPILED, CompiledServices, native
from arm_dynamics.ros.dynamics.request_counts import RequestCounts

__all__ = ["ANSWERS", "COMPILED", "CompiledServices", "RequestCounts", "native"]
