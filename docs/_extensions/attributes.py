# SPDX-License-Identifier: Apache-2.0
"""Reads the sections of Google-style docstrings: names and what is said of them."""

from __future__ import annotations

import inspect
import re


def section(thing: object, title: str) -> dict[str, str]:
    """Entries of a section such as ``Args`` or ``Attributes``, each as one line of text."""
    text = inspect.getdoc(thing) or ""
    found = re.search(rf"^{title}:\n((?:[ \t]+.*\n?|\n)*)", text, re.MULTILINE)
    if not found:
        return {}
    entries = re.findall(
        r"^ {4}\*{0,2}(\w+(?:, \w+)*)(?: \([^)]*\))?: ((?:.*\n?)(?:(?: {5,}.*)?\n?)*)",
        found[1] + "\n",
        re.MULTILINE,
    )
    said = {names: " ".join(text.split()) for names, text in entries}
    return {name: text for names, text in said.items() for name in names.split(", ")}


def first_paragraph(thing: object) -> str:
    """The summary of a docstring and what belongs to it, as one line."""
    return " ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split())
