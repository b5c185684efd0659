# SPDX-License-Identifier: Apache-2.0
"""Options of all commands as help shows them, and what the packages are asked for by them."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner

from arm_dynamics import ArmError
from arm_studies.cli.main import main


def commands(group: click.Group, path: tuple[str, ...] = ()) -> dict[str, click.Command]:
    """All commands that are no groups, by what is typed for them."""
    found: dict[str, click.Command] = {}
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        inner = (*path, name)
        if isinstance(command, click.Group):
            found |= commands(command, inner)
        elif command is not None:
            found[" ".join(inner)] = command
    return found


COMMANDS = commands(main)


def refusal(*words: str) -> str:
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 2 and done.output.count("error: ") == 1, done.output
    assert isinstance(done.exception, SystemExit)
    return " ".join(done.output.partition("error: ")[2].split())


def wrong(kind: click.ParamType) -> Iterator[tuple[str, str]]:
    """Words that an option does not take, and what is said of them."""
    if isinstance(kind, click.IntRange | click.FloatRange):
        for end, step in ((kind.min, -1), (kind.max, 1)):
            if end is not None:
                yield str(end + step), f"{end + step} is not in the range "
    if isinstance(kind, click.Choice):
        yield "neither", "'neither' is not one of " + ", ".join(f"'{x}'" for x in kind.choices)
    if kind.name in ("integer", "float", "integer range", "float range"):
        yield "much", "'much' is not a valid "


@pytest.mark.parametrize("command", COMMANDS)
def test_each_option_is_refused_by_name(command: str) -> None:
    """Misspelt, out of its range, of another type."""
    passed_on = COMMANDS[command].context_settings.get("ignore_unknown_options")
    for option in COMMANDS[command].params:
        if not isinstance(option, click.Option) or option.hidden:
            continue
        long = option.opts[-1]
        if len(long) > 4 and not passed_on:
            other = f"{long[:-1]}q{long[-1]}"
            said = refusal(*command.split(), other, "1")
            assert re.match(rf"No such option '{other}'.*[Dd]id you mean .*'{long}'", said), said
        for word, why in wrong(option.type):
            said = refusal(*command.split(), long, word)
            assert said.startswith(f"Invalid value for '{long}': {why}"), said


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_examples_and_says_what_each_option_takes(command: str) -> None:
    context = click.Context(COMMANDS[command], info_name=command)
    told = COMMANDS[command].get_help(context)
    assert re.search(rf"\n +Examples?:\n +\./arm {command.split()[0]}", told)
    for option in COMMANDS[command].params:
        if isinstance(option, click.Option) and not option.hidden:
            _, about = option.get_help_record(context) or ("", "")
            assert re.match(r"['\"A-Z].*\.", about), option.opts
            assert not option.show_default or f"[default: {option.default}" in about
            if isinstance(option.type, click.IntRange | click.FloatRange) and not option.multiple:
                assert re.search(r"\[.*x[<>].*\]|\[.*[<>]=?x.*\]|\[x[<>]", about), about


@pytest.mark.parametrize("command", COMMANDS)
def test_each_example_in_help_can_be_typed(command: str) -> None:
    for line in re.findall(r"^  \./arm ([^$|>\n]*)(?: [>|] .*)?$", COMMANDS[command].epilog, re.M):
        words = shlex.split(line)
        depth = 2 if " ".join(words[:2]) in COMMANDS else 1
        COMMANDS[" ".join(words[:depth])].make_context("arm", words[depth:])


class Stop(ArmError):
    """Nothing is computed: it is only looked at what is asked for."""


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the commands ask the packages for."""
    told: dict[str, Any] = {}

    def stop(*given: Any, **options: Any) -> Any:
        told.update(options, given=given)
        raise Stop("enough")

    of_data = [f"identification.{name}" for name in ("identify", "estimate_payload", "compare")]
    for place in (*of_data, "identification.excitation.excite", "sweeps.sweep"):
        monkeypatch.setattr(f"arm_studies.{place}", stop)
    return told


def typed(*words: object) -> None:
    done = CliRunner().invoke(main, [str(word) for word in words])
    assert "enough" in done.output or isinstance(done.exception, Stop), done.output


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "robot.csv"
    path.write_text("time,position.a,effort.a\n0,0,1\n1,1,2\n2,0,3\n")
    return path


def test_identification_is_asked_for_what_was_typed(
    asked: dict[str, Any], table: Path, tmp_path: Path
) -> None:
    out = "--out", tmp_path / "a.yaml"
    typed("identify", table, "--scene", "two_link", *out, "--band", 7.5, "--effort", "scale",
          "--map", "elbow=a", "--map", "shoulder=b", "--total-mass", 12.5, "--mass", "tip=2",
          "--accept-worse")  # fmt: skip
    assert asked.pop("on_progress") is not None
    scene, records = asked.pop("given")
    assert scene == "two_link" and records[0].effort.tolist() == [[1.0], [2.0], [3.0]]
    assert asked == {
        "band": 7.5, "effort": "scale", "names": {"elbow": "a", "shoulder": "b"},
        "total_mass": 12.5, "masses": {"tip": 2.0}, "accept_worse": True,
    }  # fmt: skip
    typed("identify", table, "--scene", "two_link", *out, "--per-unit", "elbow=0.5")
    assert asked["effort"] == {"elbow": 0.5}


def test_a_payload_is_asked_for_with_names_and_band(
    asked: dict[str, Any], table: Path, tmp_path: Path
) -> None:
    typed("identify", table, "--scene", "two_link", "--out", tmp_path / "a.yaml", "--payload",
          "tip", "--band", 3.5, "--map", "elbow=a")  # fmt: skip
    arm, records, frame = asked["given"]
    assert (frame, len(records), asked["band"], asked["names"]) == ("tip", 1, 3.5, {"elbow": "a"})
    assert "elbow" in arm.robot.urdf


def test_a_comparison_is_asked_for_what_was_typed(asked: dict[str, Any], table: Path) -> None:
    typed("compare", "two_link", table, "--band", 9.0, "--window", 0.5, "--last", 0.75, "--map",
          "elbow=a")  # fmt: skip
    scene, record = asked.pop("given")
    assert scene == "two_link" and record.joint_names == ("a",)
    assert asked == {"band": 9.0, "window": 0.5, "last": 0.75, "names": {"elbow": "a"}}


def test_an_exciting_motion_is_asked_for_as_it_was_typed(
    asked: dict[str, Any], tmp_path: Path
) -> None:
    typed("excite", "two_link", "--out", tmp_path / "a.yaml", "--period", 4, "--harmonics", 7,
          "--aim", "masses", "--attempts", 2, "--seed", 9, "--share", 0.5, "--margin", 0.1,
          "--acceleration", 30, "--clearance", 0.2, "--start", "0.1 0.2", "--frame", "tip",
          "--frame", "elbow", "--box", "-1 -2 -3 1 2 3")  # fmt: skip
    (room,) = asked.pop("given")
    asked.pop("on_progress")
    assert asked == {"period": 4.0, "harmonics": 7, "aim": "masses", "attempts": 2, "seed": 9}
    assert (room.share, room.margin, room.acceleration, room.clearance) == (0.5, 0.1, 30.0, 0.2)
    assert tuple(room.given_start) == (0.1, 0.2) and room.box.frames == ("tip", "elbow")
    assert [list(room.box.lower), list(room.box.upper)] == [[-1, -2, -3], [1, 2, 3]]


def test_a_sweep_is_asked_for_as_it_was_typed(
    asked: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    typed("sweep", "my.yaml", "--out", "there", "--workers", 3, "--cluster", "tcp://a:1")
    assert asked.pop("on_progress") is not None
    assert asked == {
        "given": (Path("my.yaml"), Path("there")), "workers": 3, "cluster": "tcp://a:1"
    }  # fmt: skip
