# SPDX-License-Identifier: Apache-2.0
"""Tables and numbers in Markdown."""

from __future__ import annotations

import re
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


_MARKER = re.compile(r"(?:[-*+]|\d+[.)])\s+")
_ATOM = re.compile(r"(?:\{\{.*?\}\}|\S)+")  # a word; a place in a template is never cut
_BLOCK = re.compile(r"[-*+]$|\d+[.)]$|#+$|[>|=~]|```|---|\$\$")  # begins something in a new line


def wrapped(text: str, width: int = 100) -> str:
    """Markdown with its paragraphs and list items broken into lines of ``width`` characters.

    Tables, headings, code and displayed mathematics stay as they are, and the rendered page is the
    same as before.
    """
    done: list[str] = []
    words: list[str] = []  # of the paragraph that is being read
    first = rest = ""  # what its first and its other lines begin with
    inside, in_list = "", False  # the fence of a block that stays as it is, if in one
    for line in text.split("\n"):
        content = line.strip()
        indent = line[: len(line) - len(line.lstrip())]
        fence = next((mark for mark in ("```", "$$") if content.startswith(mark)), "")
        indented_code = not words and not in_list and len(indent) >= 4
        if inside or fence or not content or content[0] in "|#<" or indented_code:
            done += [*_broken(words, first, rest, width), line]
            words = []
            if inside:
                inside = "" if content.endswith(inside) else inside
            elif fence and not (len(content) > len(fence) and content.endswith(fence)):
                inside = fence
            continue
        marker = _MARKER.match(content)
        if marker:
            done += _broken(words, first, rest, width)
            words, in_list = [], True
            first, rest = indent + marker[0], indent + " " * len(marker[0])
            content = content[marker.end() :]
        elif not words:
            in_list = in_list and bool(indent)
            first = rest = indent
        words += _ATOM.findall(content)
    return "\n".join(done + _broken(words, first, rest, width))


def _broken(words: Sequence[str], first: str, rest: str, width: int) -> list[str]:
    """The lines of a paragraph."""
    lines: list[str] = []
    for word in words:
        if lines and _BLOCK.match(word):  # must not come to stand at the start of a line
            before, _, last = lines.pop().rpartition(" ")
            if before.strip() and len(before) + len(last) + len(word) + 2 > width:
                lines += [before, f"{rest}{last} {word}"]
            else:
                lines.append(f"{before} {last} {word}" if before else f"{last} {word}")
        elif lines and len(lines[-1]) + 1 + len(word) <= width:
            lines[-1] += " " + word
        else:
            lines.append((rest if lines else first) + word)
    return lines
