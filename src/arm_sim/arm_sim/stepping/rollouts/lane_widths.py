# SPDX-License-Identifier: Apache-2.0
"""How many arms a vector register holds, and which numbers of them are tried."""

from collections.abc import Callable

from arm_dynamics import InvalidInput
from arm_dynamics.codegen import compiler
from arm_sim.stepping.engine import Compiled

WIDTHS = (8, 4, 2, 1)  # doubles in registers of AVX-512, AVX2 and SSE2; and without lanes


def check_lanes(lanes: int | None) -> None:
    """Refuse a number of lanes that is not one of ``WIDTHS``; None is allowed."""
    if lanes is not None and (isinstance(lanes, bool) or lanes not in WIDTHS):
        raise InvalidInput(f"lanes = {lanes!r}; allowed: {', '.join(map(str, WIDTHS))}")


def widest(
    lanes: int | None, compile_for: Callable[[int], Compiled | None]
) -> tuple[Compiled | None, int]:
    """Code for the first number of lanes of which there is any, and that number.

    Tried are the requested one and then one, else the processor's and fewer: code compiled
    elsewhere, for all processors of a level, may be of fewer lanes than fit here.

    Raises:
        InvalidInput: If the number of lanes is not allowed, see ``check_lanes``.
    """
    check_lanes(lanes)
    for width in (lanes, 1) if lanes else WIDTHS[WIDTHS.index(natural_width()) :]:
        if (code := compile_for(width)) is not None:
            return code, width
    return None, 1


def natural_width() -> int:
    """Doubles in a vector register of the processor that code is compiled for."""
    extensions = compiler.instructions()
    if "avx512f" in extensions:
        return 8
    return 4 if "avx2" in extensions else 2
