# SPDX-License-Identifier: Apache-2.0
"""Controllers without internal state as compiled functions, for loops that run in C."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.kernel import Call


@dataclass(frozen=True)
class CompiledLaw:
    """A controller as a compiled function that returns the same bits.

    Attributes:
        call: Takes q, v and the reference's q, v and a in one array of shape (5n,) and returns
            torques of shape (n,); native code with memory of its own.
        limit: Limits at which the controller cuts torques in [N m] or [N], shape (n,); None if it
            cuts none.
    """

    call: Call
    limit: Array | None = None


@runtime_checkable
class Compilable(Protocol):
    """A controller that may be available as a compiled function."""

    def compiled(self) -> CompiledLaw | None:
        """Return the function; None if it is not available."""


def compiled_law(control: object) -> CompiledLaw | None:
    """Return a controller as a compiled function; None if it is not available."""
    return control.compiled() if isinstance(control, Compilable) else None
