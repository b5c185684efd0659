# SPDX-License-Identifier: Apache-2.0
"""Pages of text: paragraphs and lists are broken into lines, everything else stays."""

from __future__ import annotations

import pytest

from benchmarks.reporting.markdown import wrapped

LONG = "word " * 40


def test_a_paragraph_becomes_lines_with_the_same_words() -> None:
    text = wrapped(f"short\n{LONG}\n")
    lines = text.split("\n")
    assert max(map(len, lines)) <= 100
    assert min(map(len, lines[:-2])) > 90  # full ones
    assert text.split() == ["short", *LONG.split()]


def test_items_keep_their_marker_and_hang_under_it() -> None:
    first, *others = wrapped(f"- {LONG}\n  {LONG}\n- two").split("\n")
    assert first.startswith("- word")
    assert others[-1] == "- two"
    assert all(line.startswith("  word") for line in others[:-1])


@pytest.mark.parametrize(
    "block",
    [
        f"# {LONG}",
        f"| {LONG} |",
        f"```\n{LONG}\n\n{LONG}\n```",
        f"    {LONG}",
        f"$$ {LONG}\n= 1 $$",
    ],
    ids=["heading", "table", "fence", "indented code", "mathematics"],
)
def test_what_is_no_text_stays(block: str) -> None:
    assert wrapped(f"a\n\n{block}\n\nb") == f"a\n\n{block}\n\nb"


@pytest.mark.parametrize("sign", ["-", "+", "=", "1.", "#", "|x|"])
def test_no_line_begins_with_what_would_begin_a_block(sign: str) -> None:
    lines = wrapped(f"{'w' * 49} {'w' * 48} w {sign} w").split("\n")
    assert len(lines) == 2
    assert lines[1].split() == ["w", sign, "w"]


def test_a_place_in_a_template_is_not_cut() -> None:
    place = "{{long pendulum|rk4|0.001}}"
    assert place in wrapped("w " * 45 + place)
