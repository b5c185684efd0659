# SPDX-License-Identifier: Apache-2.0
"""Errors that the suite raises on purpose.

Each says what is wrong, the value and what is allowed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable


class ArmError(Exception):
    """Base of all errors of the suite."""


class SceneError(ArmError):
    """A scene file, or a part of it, cannot be used."""


class ModelError(SceneError):
    """The robot description cannot be used: malformed, unsupported or unphysical."""


class InvalidInput(ArmError, ValueError):
    """An argument has the wrong shape, an unknown name or a value that is not allowed."""


class ConstraintError(SceneError, InvalidInput):
    """Constraints that cannot hold from where the robot is.

    ``residuals`` says how far each one stays open, in [m] or [rad].
    """

    def __init__(self, message: str, residuals: dict[str, float] | None = None) -> None:
        super().__init__(message)
        self.residuals = residuals or {}


class Unreachable(ArmError):
    """A pose or a path that the arm cannot take; ``residual`` is what is missing, if known."""

    def __init__(self, message: str, residual: float = math.nan) -> None:
        super().__init__(message)
        self.residual = residual


class KernelError(ArmError):
    """Generated code cannot be compiled, or disagrees with Pinocchio and is refused."""


class CompilerMissing(KernelError):
    """There is no compiler, and no code that was compiled elsewhere either."""


class ControllerFailed(ArmError):
    """A controller of somebody's own raised, or returned what is no torque."""


class NoAnswer(ArmError, TimeoutError):
    """No node offers a service, or the one that does gave no answer in time."""


class Refused(ArmError):
    """A node answered that it will not do what it was asked; the message is the node's."""


def known_names(names: Iterable[str], limit: int = 30) -> str:
    """List the names that would have been accepted as ``a, b, c``, cut after ``limit``."""
    listed = list(names)
    more = f", … ({len(listed) - limit} more)" if len(listed) > limit else ""
    return (", ".join(listed[:limit]) + more) or "none"
