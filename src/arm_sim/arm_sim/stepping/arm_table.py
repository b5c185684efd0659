# SPDX-License-Identifier: Apache-2.0
"""Many arms and their ticks, as compiled code takes them."""

from __future__ import annotations

import ctypes
from itertools import compress

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.addresses import address, strides
from arm_dynamics.codegen.header import Header
from arm_sim.stepping.engine import NATIVE
from arm_sim.stepping.stepper import Stepper


class Engine(ctypes.Structure):
    """Functions of the compiled engine of one arm: ``engine_t`` of ``prediction.h``."""

    _fields_ = Header(NATIVE / "modes/prediction.h", only="engine_t").fields("engine_t")

    @classmethod
    def of(cls, stepper: Stepper) -> Engine:
        """The functions of a scene with events."""
        assert stepper.compiled is not None
        functions = (getattr(stepper.compiled.engine, name) for name, _ in cls._fields_[1:])
        addresses = (ctypes.cast(function, ctypes.c_void_p).value for function in functions)
        return cls(stepper.compiled.scene.value, *addresses)


class RolloutFlags:
    """Arms that lanes leave to be advanced alone, set by compiled code; and what halts it.

    Attributes:
        addresses: Of the arms' flags and of the halting flag, for ``arms_t``.
    """

    def __init__(self, arms: int) -> None:
        self._unfinished, self._halted = (ctypes.c_char * arms)(), ctypes.c_int8()
        self.addresses = ctypes.addressof(self._unfinished), ctypes.addressof(self._halted)

    def marked(self, first: int, last: int) -> list[int]:
        """The arms from ``first`` to before ``last`` that are to be advanced alone."""
        return list(compress(range(first, last), self._unfinished.raw[first:]))

    @property
    def halted(self) -> bool:
        """Whether compiled code is to return at its next tick, its results being of no use."""
        return bool(self._halted.value)

    def halt(self) -> None:
        """Let compiled code return at its next tick."""
        self._halted.value = 1


class ArmTable(ctypes.Structure):
    """Arms and their ticks for compiled code: ``arms_t`` of ``lanes.h``."""

    _fields_ = Header(NATIVE / "lanes/lanes.h", only="arms_t").fields("arms_t")

    @classmethod
    def of(
        cls, x0: Array, tau: Array, p: Array, dt: float, flags: RolloutFlags, engine: Engine | None
    ) -> ArmTable:
        """A table of arrays, which must live as long.

        Args:
            x0: Initial states, shape (b, nx).
            tau: Commands, shape (b, ticks, n).
            p: Parameters, shape (b, np).
            dt: Length of a tick in [s].
            flags: Receives which arms are to be advanced alone.
            engine: In a scene with events.
        """
        return cls(
            *map(address, (x0, tau, p)), *strides(tau, 2), *strides(p, 1), dt, tau.shape[1],
            *flags.addresses, None if engine is None else ctypes.addressof(engine),
        )  # fmt: skip
