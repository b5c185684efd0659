# SPDX-License-Identifier: Apache-2.0
"""Text from outside is shown on one line, printable and of bounded length."""

from pathlib import Path

import pytest

from arm_dynamics import ArmError
from arm_dynamics.exceptions import NotWritten, choices, known_names, plain
from arm_dynamics.writing import replacing


def test_what_is_not_printable_is_escaped() -> None:
    assert plain("elbow") == "elbow"
    assert plain("bell\x07, right\u202eto left") == r"bell\x07, right\u202eto left"


def test_the_middle_of_a_long_text_is_left_out_and_both_ends_stay() -> None:
    text = "unknown joint '" + "x" * 400_000 + "'; allowed: elbow"
    shown = plain(text)
    assert len(shown) < 1100
    assert shown.startswith("unknown joint 'xx") and shown.endswith("xx'; allowed: elbow")


def test_an_empty_name_is_seen_in_a_list() -> None:
    assert known_names(["", "elbow"]) == "'', elbow"
    assert known_names([]) == "none"


def test_a_name_is_suggested_also_from_beyond_those_that_are_listed() -> None:
    names = [*(f"finger_{letter}" for letter in "abcdefghij"), "shoulder"]
    told = choices("sholder", names, limit=3)
    assert "finger_d" not in told and told.endswith("did you mean 'shoulder'?")


def write(path: Path, text: str) -> None:
    with replacing(path) as part:
        part.write_text(text)


def test_a_file_that_exists_is_replaced_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write(tmp_path / "a.txt", "one")
    assert not caplog.text
    write(tmp_path / "a.txt", "two")
    assert f"'{tmp_path}/a.txt' existed and is replaced" in caplog.text
    assert (tmp_path / "a.txt").read_text() == "two"


def test_what_fails_leaves_the_file_as_it_was_and_nothing_beside_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write(tmp_path / "a.txt", "one")
    with pytest.raises(ZeroDivisionError), replacing(tmp_path / "a.txt") as part:
        part.write_text(str(1 / 0))
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"] and not caplog.text
    assert (tmp_path / "a.txt").read_text() == "one"


@pytest.mark.parametrize("path", ["/proc/a.txt", "/dev/null/a.txt"])
def test_what_the_system_refuses_is_one_line_about_the_file_that_was_asked_for(path: str) -> None:
    with pytest.raises(NotWritten, match=f"^'{path}' cannot be written: [A-Z][a-z ]*$") as caught:
        write(Path(path), "one")
    assert isinstance(caught.value, ArmError) and isinstance(caught.value, OSError)


def test_an_error_of_the_suite_stays_what_it_is(tmp_path: Path) -> None:
    with pytest.raises(NotWritten, match="elsewhere"), replacing(tmp_path / "a.txt"):
        raise NotWritten("elsewhere")
