# SPDX-License-Identifier: Apache-2.0
"""Files are replaced whole and audibly, or left as they were."""

from pathlib import Path

import pytest

from arm_dynamics import ArmError
from arm_dynamics.exceptions import NotWritten
from arm_dynamics.writing import replacing


def write(path: Path, text: str) -> None:
    with replacing(path) as part:
        part.write_text(text)


def test_a_file_that_exists_is_replaced_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write(tmp_path / "a.txt", "one")
    assert not caplog.text
    write(tmp_path / "a.txt", "two")
    assert [r.getMessage() for r in caplog.records] == [
        f"'{tmp_path}/a.txt' existed and is replaced"
    ]
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
