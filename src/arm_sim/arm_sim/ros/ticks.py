# SPDX-License-Identifier: Apache-2.0
"""What C and Python share of the ticks of a sim node, and what C asks Python for."""

from collections.abc import Callable, Sequence
from ctypes import CFUNCTYPE, Structure, c_int64, c_void_p, cast

from arm_sim.ros.node_library import TICKS

_ASK = CFUNCTYPE(c_int64, c_int64)
_NEVER = 1 << 62  # ticks: more than there will be


class Ticks(Structure):
    """``ticks_t`` of ticks.h, where the fields are explained.

    Attributes:
        before_ticks: Called before C executes ticks, and after each answer, to pass changes to C.
        error: Exception that an answer has raised, for which C has returned.
    """

    _fields_ = TICKS.fields("ticks_t")

    def __init__(self) -> None:
        self._answers: dict[int, Callable[[], object]] = {}
        self.before_ticks = list[Callable[[], object]]()
        self.error: BaseException | None = None
        self._ask = _ASK(self._reply)
        ask = cast(self._ask, c_void_p).value
        super().__init__(ask=ask, state_period=1, slow_period=_NEVER, share=1.0)

    def answer(self, **functions: Callable[[], object]) -> None:
        """Set the functions that answer questions of C, by name; truth or numbers are answers."""
        for name, function in functions.items():
            self._answers[TICKS.constants[name.upper()]] = function

    def trust(self, kinds: Sequence[bool]) -> None:
        """Let C accept commands of some kinds of messages without Python."""
        self.trusted_kinds[:] = [*kinds, *[False] * (len(self.trusted_kinds) - len(kinds))]

    def _reply(self, question: int) -> int:
        try:
            answer = self._answers[question]()
            self.refresh()
        except BaseException as error:  # also KeyboardInterrupt: C must return first
            self.error, self.broken = error, 1
            return 0
        return answer if isinstance(answer, int) else 0

    def refresh(self) -> None:
        """Pass changes to C."""
        for listener in self.before_ticks:
            listener()
