# SPDX-License-Identifier: Apache-2.0
"""Errors that the suite raises on purpose.

Each says what is wrong, the value and what is allowed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from difflib import get_close_matches

_NAME = 80  # characters of a name that are shown


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


def plain(text: object, most: int = 1000) -> str:
    """What others wrote, or a message that repeats it, as one line that is safe to show.

    Characters that are not printable (ends of lines, marks that turn the direction of writing) are
    escaped, and of a long text the middle is left out.

    Args:
        text: Anything; its text is meant.
        most: Characters after which the middle is left out.
    """
    whole = str(text)
    half = most // 2
    if len(whole) <= most:
        return _printable(whole)
    left_out = f" … ({len(whole) - 2 * half} characters) … "
    return _printable(whole[:half]) + left_out + _printable(whole[-half:])


def _printable(text: str) -> str:
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def known_names(names: Iterable[str], limit: int = 30) -> str:
    """List the names that would have been accepted as ``a, b, c``, cut after ``limit``."""
    listed = [plain(name, _NAME) for name in names]
    more = f", … ({len(listed) - limit} more)" if len(listed) > limit else ""
    return (", ".join(listed[:limit]) + more) or "none"


def did_you_mean(name: object, names: Iterable[str]) -> str:
    """The name that was possibly meant, as the end of a message; empty if none is near.

    Names that differ in nothing but numbers are not near: ``joint9`` does not mean ``joint4``.
    """
    if not isinstance(name, str):
        return ""
    others = {other.casefold(): other for other in names if _bare(other) != _bare(name)}
    near = get_close_matches(name.casefold(), others, n=1)
    return f"; did you mean '{others[near[0]]}'?" if near else ""


def choices(name: object, names: Iterable[str], limit: int = 30) -> str:
    """What to write after ``allowed:``: the names, and the one that was possibly meant."""
    listed = list(names)
    return known_names(listed, limit) + did_you_mean(name, listed)


def _bare(name: str) -> str:
    return re.sub(r"\d", "", name)
