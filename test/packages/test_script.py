# SPDX-License-Identifier: Apache-2.0
"""The script ./arm: what it installs, and what it does where nothing is installed."""

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from installed import MADE, ROOT

NOBODY = 65534
SET_UP_FROM = (
    "arm", "tools/setup.sh", "tools/arm_environment.py", "requirements.txt", "src", "interfaces",
)  # fmt: skip
WITHOUT_JAZZY = {"PATH": os.environ["PATH"], "HOME": "/nonexistent"}


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A clone in which nothing is set up."""
    shutil.copy(ROOT / "arm", tmp_path)
    return tmp_path


@pytest.fixture
def older(clone: Path) -> Path:
    """A clone with the environment of an older one; its Python prints HOME and its arguments."""
    python = clone / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text('#!/bin/sh\necho "$HOME" "$@"\n')
    python.chmod(0o755)
    (clone / ".venv/stamp").write_text("another\n")
    return clone


def arm(clone: Path, line: str, **more: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [clone / "arm", *line.split()],
        **{"env": WITHOUT_JAZZY, "cwd": clone, **more},
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60,
    )  # type: ignore[call-overload, no-any-return]  # fmt: skip


def files(folder: Path) -> set[Path]:
    return set(folder.rglob("*"))


ASK = ("test -h", "completion bash")


@pytest.mark.parametrize("line", ASK)
def test_who_only_asks_installs_nothing(clone: Path, line: str) -> None:
    before = files(clone)
    done = arm(clone, line)
    assert done.returncode == 1 and done.stdout == ""
    assert "nothing is set up yet" in done.stderr and "./arm setup" in done.stderr
    assert files(clone) == before


@pytest.mark.parametrize("line", ASK)
def test_who_only_asks_is_answered_from_what_is_there(older: Path, line: str) -> None:
    before = files(older)
    done = arm(older, line)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split()[-1] == line.split()[-1]
    assert files(older) == before


SOURCED = {"AMENT_PREFIX_PATH": "/opt/ros"}


@pytest.mark.parametrize(
    ("variables", "place"),
    [
        ({}, ".venv"),
        ({"ROS_DISTRO": "jazzy"}, ".venv"),
        ({"ROS_DISTRO": "kilted"}, ".venv-pypi-kilted"),
        ({"ROS_DISTRO": "rolling", **SOURCED}, ".venv"),
        ({"ROS_DISTRO": "jazzy", **SOURCED}, ".venv-jazzy"),
        ({"ROS_DISTRO": "kilted", **SOURCED}, ".venv-kilted"),
    ],
)
def test_the_distribution_decides_on_the_environment(
    variables: dict[str, str], place: str, clone: Path
) -> None:
    for name in (".venv", ".venv-pypi-kilted", ".venv-jazzy", ".venv-kilted"):
        python = clone / name / "bin/python"
        python.parent.mkdir(parents=True)
        python.write_text('#!/bin/sh\necho "$VIRTUAL_ENV"\n')
        python.chmod(0o755)
        (clone / name / "stamp").touch()
        (clone / name / "pyvenv.cfg").touch()
    done = arm(clone, "view --help", env=WITHOUT_JAZZY | variables)
    assert (done.stdout, done.stderr) == (f"{clone / place}\n", "")
    # What ./arm starts finds the same: an environment of its own is no sourced ROS.
    if "pypi" in place:
        own = {"AMENT_PREFIX_PATH": str(clone / place)}
        assert arm(clone, "view --help", env=WITHOUT_JAZZY | variables | own).stdout == done.stdout


@pytest.mark.parametrize("line", ["lint -h", ""])
def test_commands_without_options_show_all_commands(clone: Path, line: str) -> None:
    done = arm(clone, line)
    assert done.returncode == 0 and "./arm COMMAND" in done.stdout


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("setup view veiw", "'veiw': there is no such group; allowed: view, sweep, jax, fmu"),
        ("lint src", "lint takes no arguments, and was given 'src'"),
    ],
)
def test_what_is_no_group_and_arguments_of_lint_are_refused(
    line: str, why: str, clone: Path
) -> None:
    done = arm(clone, line)
    assert done.returncode == 1 and done.stderr.endswith(f"{why}\n")
    assert done.stderr.count("\n") == 1


def test_an_unknown_command_installs_nothing(clone: Path, older: Path) -> None:
    (clone / ".venv").rename(clone / "kept")
    before = files(clone)
    done = arm(clone, "demos panda")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "arm: unknown command 'demos'; ./arm help shows all\n"
    assert files(clone) == before
    (clone / "kept").rename(clone / ".venv")  # the suite says what may be meant
    assert arm(clone, "demos panda").stdout.split()[-2:] == ["demos", "panda"]


def test_signals_wait_until_python_listens(older: Path) -> None:
    """Python shows a traceback of its own start otherwise."""
    (older / ".venv/bin/python").write_text("#!/bin/bash\ngrep SigBlk /proc/self/status\n")
    held = int(arm(older, "sim panda --help").stdout.split()[-1], base=16)
    assert held == sum(1 << number - 1 for number in (signal.SIGINT, signal.SIGTERM))


def test_without_home_it_is_the_users(older: Path) -> None:
    done = arm(older, "view --help", env={"PATH": os.environ["PATH"]})
    assert done.stdout.split()[0] == pwd.getpwuid(os.getuid()).pw_dir


@pytest.fixture
def closed() -> Iterator[Path]:
    """A clone that its user may read, but not write."""
    with tempfile.TemporaryDirectory() as made:  # other users cannot read pytest's folders
        folder = Path(made)
        for name in SET_UP_FROM:
            (folder / name).parent.mkdir(exist_ok=True)
            if (ROOT / name).is_dir():
                shutil.copytree(ROOT / name, folder / name, ignore=MADE)
            else:
                shutil.copy(ROOT / name, folder / name)
        folder.chmod(0o555)
        yield folder
        folder.chmod(0o755)


def test_an_environment_of_another_is_not_replaced(closed: Path) -> None:
    closed.chmod(0o755)
    (closed / ".venv").mkdir()
    (closed / ".venv/mine").touch()
    done = arm(closed, "setup")
    assert done.returncode == 1 and f"{closed}/.venv is not an environment" in done.stderr
    assert (closed / ".venv/mine").exists()


# What follows a program of the user's does not ask ./arm.
@pytest.mark.parametrize("line", ["setup", "python mine.py --help"])
def test_a_folder_that_cannot_be_written_is_named(closed: Path, line: str) -> None:
    as_another = {"user": NOBODY, "group": NOBODY, "extra_groups": []} if not os.getuid() else {}
    done = arm(closed, line, **as_another)
    assert done.returncode == 1
    assert done.stderr.startswith(f"arm: cannot write to {closed}, where set-up puts everything;")
    assert done.stderr.count("\n") == 1


def test_set_up_tells_what_it_does_without_a_terminal(tmp_path: Path) -> None:
    """In a line every ten seconds, here every second."""
    (tmp_path / "log").mkdir()
    script = f'root={tmp_path}; env=$root/.venv; say() {{ echo "$*" >&2; }}\n'
    script += f"source {ROOT}/tools/setup.sh\n"
    script += '[[ $pause == 10 ]]; pause=1; step "Waiting" bash -c "echo something; sleep 3.3"'
    done = subprocess.run(["bash", "-euc", script], capture_output=True, text=True, timeout=60)
    first, *between, last = done.stderr.splitlines()
    assert (done.returncode, first) == (0, "  Waiting ...")
    assert len(between) >= 2 and all(line.endswith("s  something") for line in between)
    assert last.startswith("  Waiting ... ")
