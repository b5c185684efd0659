# SPDX-License-Identifier: Apache-2.0
"""Tables and numbers in Markdown."""

from collections.abc import Iterable, Sequence


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table; numbers are formatted before."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def number(value: float | None, digits: int = 3) -> str:
    """A number with ``digits`` significant digits; a dash where there is none."""
    if value is None:
        return "—"
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 10**digits:
        return f"{value:.{digits}g}"
    if abs(value) >= 10**digits and abs(value) < 1e7:
        return f"{value:,.0f}"
    return f"{value:.{digits - 1}e}".replace("e-0", "e-").replace("e+0", "e")


def quantity(value: float | None, unit: str) -> str:
    """A number and its unit; a ratio below one half is shown as a fraction of one."""
    if value is None:
        return "—"
    if unit == "×":
        return f"1/{1 / value:.3g}" if 0 < value < 0.1 else f"{value:.2f}"
    return f"{number(value)} {unit}"


def duration(seconds: float | None) -> str:
    """A time with the unit that suits it."""
    if seconds is None:
        return "—"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"
