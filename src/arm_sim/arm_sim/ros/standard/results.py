# SPDX-License-Identifier: Apache-2.0
"""Result codes of simulation_interfaces, and exceptions that carry one."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from arm_dynamics import ArmError
from arm_dynamics.logs import Throttled

# Result.msg
UNSUPPORTED, OK, NOT_FOUND, INCORRECT_STATE, FAILED = range(5)
# SetSimulationState.srv
ALREADY_THERE, INCORRECT_TRANSITION = 101, 103


class Refusal(ArmError):
    """A request that is refused, with its code."""

    def __init__(self, code: int, why: str) -> None:
        super().__init__(why)
        self.code = code


@contextmanager
def filled_result(result: Any, log: Throttled) -> Iterator[None]:
    """Fill a ``simulation_interfaces/Result``; no request ends the node."""
    try:
        yield
    except Refusal as error:
        result.result, result.error_message = error.code, str(error)
    except ArmError as error:
        result.result, result.error_message = FAILED, str(error)
    except Exception as error:
        log.error(f"a service call failed unexpectedly: {error!r}")
        result.result, result.error_message = FAILED, f"unexpected failure: {error!r}"
    else:
        result.result = OK


def service_callback(answer: Callable[[Any, Any], None], log: Throttled) -> Callable[..., Any]:
    """A service callback from a function that fills the response or raises an exception."""

    def callback(request: Any, response: Any) -> Any:
        with filled_result(response.result, log):
            answer(request, response)
        return response

    return callback
