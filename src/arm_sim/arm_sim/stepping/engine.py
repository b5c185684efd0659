# SPDX-License-Identifier: Apache-2.0
"""The engine in ``native/``, a C library that is compiled once.

Each scene has a library of its own, from generated C: see ``scene_source``.
"""

import ctypes
from functools import cache, cached_property
from pathlib import Path

from arm_dynamics.codegen import compiler

NATIVE = Path(__file__).parent / "native"
# Flags for compilers, see ``compiler.build``
INCLUDED = (f"-I{NATIVE}",)
# Units of the library for several arms side by side, and of that for one at a time
LANE_UNITS = (
    "lanes/rollout.c", "lanes/adaptive_rollout.c", "derivatives/gradient.c",
    "derivatives/tangent_ticks.c",
)  # fmt: skip
ARM_UNITS = (
    "arm/arm.c", *LANE_UNITS, "derivatives/tick_derivative.c", "derivatives/tangent_step.c",
    "derivatives/eventful_derivatives.c", "derivatives/event_free_gradient.c",
)  # fmt: skip
# The engine consists of loops, unlike generated code: short ones, slower as calls of memcpy.
_FLAGS = ("-O2", "-fno-tree-loop-distribute-patterns", *compiler.FLAGS[1:])
# Name of the structure in generated code
SYMBOL = "own_scene"


@cache
def _library(where: compiler.Destination | None, width: int, units: tuple[str, ...],
             folders: tuple[str, ...]) -> ctypes.CDLL:  # fmt: skip
    first, *rest = (f'{lane_header(width)}#include "{unit}"\n' for unit in units)
    local, language = (*INCLUDED, *folders), "c" if width == 1 else "c++"
    with compiler.describing("engine"):
        return compiler.build(first, language, _FLAGS, local, tuple(rest)).library


def lane_header(width: int) -> str:
    """Beginning of a file of C for ``width`` arms side by side."""
    if width == 1:
        return '#include "scalar.h"\n'
    return f'#define LANES {width}\n#include "lanes.hpp"\n'


def library(
    width: int = 1, units: tuple[str, ...] = (), folders: tuple[str, ...] = ()
) -> ctypes.CDLL:
    """The engine's library, compiled at its first use.

    Args:
        width: Arms side by side.
        units: Files of it; all, if none is named.
        folders: Flags for the compiler that name folders of other files.

    Raises:
        CompilerMissing: If there is neither a compiler nor a library compiled elsewhere.
    """
    units = units or (ARM_UNITS if width == 1 else LANE_UNITS)
    return _library(compiler.destination(), width, units, folders)


class Compiled:
    """Compiled functions of a scene, and the engine for as many arms side by side.

    Attributes:
        own: Library of the scene.
        engine: Library of the engine.
        scene: Address of its structure, the first argument of the engine's functions.
    """

    def __init__(self, own: ctypes.CDLL, engine: ctypes.CDLL) -> None:
        self.own, self.engine = own, engine
        self.scene = ctypes.c_void_p(address_of(own))

    @cached_property
    def tick(self) -> int | None:
        """Address of the engine's function for one tick of one arm."""
        return ctypes.cast(self.engine.arm_tick, ctypes.c_void_p).value


@cache
def address_of(own: ctypes.CDLL, symbol: str = SYMBOL) -> int:
    """Address of a structure in a library of generated code."""
    return ctypes.addressof(ctypes.c_char.in_dll(own, symbol))
