# SPDX-License-Identifier: Apache-2.0
"""Text from outside is shown on one line, printable and of bounded length."""

import pytest

from arm_dynamics.exceptions import choices, known_names, plain


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("elbow", "elbow"),
        ("right\u202eto left\u200f", r"right\u202eto left\u200f"),
        ("bell\x07\x1b[31m", r"bell\x07\x1b[31m"),
    ],
)
def test_what_is_not_printable_is_escaped(text: str, shown: str) -> None:
    assert plain(text) == shown


def test_the_middle_of_a_long_text_is_left_out_and_both_ends_stay() -> None:
    text = "unknown joint '" + "x" * 400_000 + "'; allowed: elbow"
    shown = plain(text)
    assert len(shown) < 1100
    assert shown.startswith("unknown joint 'xx")
    assert shown.endswith("xx'; allowed: elbow")
    assert "characters" in shown


def test_an_empty_name_is_seen_in_a_list() -> None:
    assert known_names(["", "elbow"]) == "'', elbow"
    assert known_names([]) == "none"


def test_a_name_is_suggested_also_from_beyond_those_that_are_listed() -> None:
    names = [*(f"finger_{letter}" for letter in "abcdefghij"), "shoulder"]
    told = choices("sholder", names, limit=3)
    assert "finger_d" not in told and told.endswith("did you mean 'shoulder'?")
