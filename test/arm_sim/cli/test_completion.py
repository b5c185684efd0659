# SPDX-License-Identifier: Apache-2.0
"""Completion of command lines in a shell, and its speed."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from arm_sim.cli.completion import OF_CLONE, VARIABLE
from arm_studies.cli.main import main

ROOT = Path(__file__).parents[3]
SCRIPT = (ROOT / "arm").read_text()


def offered(line: str, **environment: str) -> list[str]:
    """What click answers a shell for a line whose last word is half-typed."""
    words = line.split(" ")
    done = subprocess.run(
        [sys.executable, "-P", "-m", "arm_studies.cli"],
        capture_output=True, text=True, timeout=60,
        env={**os.environ, **environment, VARIABLE: "bash_complete", "COMP_WORDS": line,
             "COMP_CWORD": str(len(words) - 1)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return [entry.partition(",")[2] for entry in done.stdout.splitlines()]


def test_commands_those_of_the_script_and_options() -> None:
    assert offered("./arm te", ARM_COMMANDS="test lint") == ["test"]
    assert offered("arm call inv") == ["inverse-dynamics", "inverse-kinematics"]
    assert offered("arm describe panda --to") == ["--tolerance"]


def test_scenes_and_robots_in_this_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "slide.urdf").touch()
    monkeypatch.chdir(tmp_path)
    assert offered("arm sim slid") == ["slider_crank", "slider_crank_motor", "slide.urdf"]
    assert offered("arm replay run.mcap --scene kin") == ["kinova"]


def test_bash_completes_every_path_that_ends_in_arm(tmp_path: Path) -> None:
    bash = shutil.which("bash")
    assert bash
    call = tmp_path / "arm"
    call.write_text(f'#!{bash}\nexec {sys.executable} -P -m arm_studies.cli "$@"\n')
    call.chmod(0o755)
    script = f"""
eval "$({call} completion bash)"
complete -p arm
COMP_WORDS=(./arm describe pand) COMP_CWORD=2
_arm_completion ./arm pand describe
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    done = subprocess.run(
        [bash, "-euc", script], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.splitlines() == [
        "complete -o nosort -F _arm_completion arm",
        "panda", "panda_lugre_table", "panda_pen", "panda_table",
    ], done.stderr  # fmt: skip


@pytest.mark.parametrize(("shell", "typed"), [("zsh", "${words[1]}"), ("fish", "-opc)[1]")])
def test_other_shells_call_what_was_typed(shell: str, typed: str) -> None:
    said = CliRunner().invoke(main, ["completion", shell]).output
    (call,) = (line for line in said.splitlines() if f"{VARIABLE}={shell}_complete" in line)
    assert typed in call and re.search(r"(compdef|complete)\b.* arm\b", said)


def test_completion_and_help_start_nothing_heavy() -> None:
    code = (
        "import sys, arm_studies.cli.main as suite\n"
        "heavy = {'casadi', 'numpy', 'pinocchio', 'pydantic'} & set(sys.modules)\n"
        "suite.main(['demo', '--help'], standalone_mode=False)\n"
        "print(heavy | {'rclpy', 'matplotlib', 'rich', 'arm_msgs'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.endswith("set()\n"), done.stderr


def test_the_script_names_its_own_commands() -> None:
    labels = re.findall(r"^    ([a-z-]+)(?: \| [-\w| ]+)?\)$", SCRIPT, re.MULTILINE)
    own = set(labels) - set(main.commands) - {"view"}
    (named,) = re.findall(r'^export ARM_COMMANDS="(.*)"$', SCRIPT, re.MULTILINE)
    assert set(named.split()) == own == {*OF_CLONE.split(), "help"}
    assert "a clone of the repository: there, bash arm" in CliRunner().invoke(main, "docs").output
