# SPDX-License-Identifier: Apache-2.0
"""Methods of ``Derivatives`` as those of a simulator, whose scene and present values they use."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import MethodType
from typing import TYPE_CHECKING, Any, Concatenate

from arm_dynamics.attributes import with_arguments

if TYPE_CHECKING:
    from arm_sim.derivatives import Derivatives
    from arm_sim.simulation.simulator import Simulator


class DerivativeMethod[**P, R]:
    """A method of ``Derivatives`` as one of a simulator, with its signature and documentation.

    It is imported when it is first used, since most runs need no derivatives.
    """

    def __init__(self, method: Callable[[], Callable[Concatenate[Derivatives, P], R]]) -> None:
        self._method = method

    def __get__(self, simulator: Simulator | None, owner: type[Simulator]) -> Callable[P, R]:
        """The method of a simulator, or of its class."""
        function: Any = self._method()
        if simulator is not None:
            function = MethodType(with_arguments(function), simulator.arm.compiled.derivatives)
        method: Callable[P, R] = function
        return method


@cache
def derivatives() -> type[Derivatives]:
    """The class that has the methods."""
    from arm_sim.derivatives import Derivatives

    return Derivatives
