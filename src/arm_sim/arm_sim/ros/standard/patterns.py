# SPDX-License-Identifier: Apache-2.0
"""POSIX extended regular expressions, which the standard prescribes, by the C library."""

import ctypes

from arm_dynamics import InvalidInput
from arm_dynamics.exceptions import plain

_LONGEST = 200  # characters
_EXTENDED, _NO_PLACES = 1, 8  # REG_EXTENDED and REG_NOSUB of regex.h in the GNU C library
_ROOM = 256  # bytes; a regex_t has 64


class Pattern:
    """Matches names; compiled once, freed at the end.

    Intervals and back references are rejected, since they may take exponential time.

    Args:
        expression: A POSIX extended regular expression; it may match any part of a name.

    Raises:
        InvalidInput: If it is invalid or too long.
    """

    def __init__(self, expression: str) -> None:
        self._expression, self._compiled = ctypes.create_string_buffer(_ROOM), False
        refused = [c for c in ("{", "\0") if c in expression]
        if len(expression) > _LONGEST or refused or any(f"\\{i}" in expression for i in range(10)):
            raise InvalidInput(
                f"filter '{plain(expression, 80)}': allowed: {_LONGEST} characters without "
                "intervals {…}, back references and zeros"
            )
        self._c = ctypes.CDLL(None)
        code = self._c.regcomp(self._expression, expression.encode(), _EXTENDED | _NO_PLACES)
        if code:
            why = ctypes.create_string_buffer(_ROOM)
            self._c.regerror(code, self._expression, why, _ROOM)
            raise InvalidInput(
                f"filter '{plain(expression, 80)}' is not a POSIX extended regular expression: "
                f"{why.value.decode()}"
            )
        self._compiled = True

    def finds(self, name: str) -> bool:
        """Whether it matches a part of the name."""
        return self._c.regexec(self._expression, name.encode(), 0, None, 0) == 0

    def __del__(self) -> None:
        """Free the compiled expression."""
        if self._compiled:
            self._c.regfree(self._expression)
