# SPDX-License-Identifier: Apache-2.0
"""Options of all commands as help shows them, and what the packages are asked for by them."""

from __future__ import annotations

import re
from math import inf
from pathlib import Path
from typing import Any

import click
import pytest
import yaml
from click.testing import CliRunner

from arm_dynamics import ArmError
from arm_studies.cli.main import main

EXPECTED = yaml.safe_load(Path(__file__).with_name("options.yaml").read_text(encoding="utf-8"))


def commands(group: click.Group, path: tuple[str, ...] = ()) -> list[str]:
    """All commands that are no groups."""
    found = []
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        inner = (*path, name)
        found += (
            commands(command, inner) if isinstance(command, click.Group) else [" ".join(inner)]
        )
    return found


def shown(command: str) -> dict[str, str]:
    """What the help of a command says of each option apart from its description."""
    told = CliRunner().invoke(main, [*command.split(), "--help"], terminal_width=400)
    assert told.exit_code == 0, told.output
    assert re.search(r"\n +Examples?:\n +\./arm ", told.output)
    text = told.output.partition("\nOptions:\n")[2].partition("\n\nExamples")[0]
    found = {}
    for part in re.split(r"\n  (?=-)", f"\n{text}")[1:]:
        usage, _, about = part.strip().partition("  ")
        name, *value = usage.split(maxsplit=1)
        extra = re.search(r"\[([^][]*)\]$", about.strip())
        found[name] = ", ".join([*([] if value else ["flag"]), *([extra[1]] if extra else [])])
    assert found.pop("-h,") == ""
    return found


@pytest.mark.parametrize("command", commands(main))
def test_options_are_flags_or_have_the_defaults_and_ranges_that_are_meant(command: str) -> None:
    assert shown(command) == EXPECTED.get(command, {})


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
    typed("identify", table, "--scene", "two_link", *out)
    assert asked.pop("told") is not None
    scene, records = asked.pop("given")
    assert scene == "two_link" and records[0].effort.tolist() == [[1.0], [2.0], [3.0]]
    assert asked == {
        "band": None, "effort": "torque", "names": {}, "total_mass": None, "masses": {},
        "accept_worse": False,
    }  # fmt: skip
    typed("identify", table, "--scene", "two_link", *out, "--band", 7.5, "--effort", "scale",
          "--map", "elbow=a", "--map", "shoulder=b", "--total-mass", 12.5, "--mass", "tip=2",
          "--accept-worse")  # fmt: skip
    assert {name: asked[name] for name in asked if name not in ("given", "told")} == {
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
    typed("compare", "two_link", table)
    scene, record = asked.pop("given")
    assert scene == "two_link" and record.joint_names == ("a",)
    assert asked == {"band": None, "window": 0.25, "last": 1.0, "names": {}}
    typed("compare", "two_link", table, "--band", 9.0, "--window", 0.5, "--last", 0.75, "--map",
          "elbow=a")  # fmt: skip
    asked.pop("given")
    assert asked == {"band": 9.0, "window": 0.5, "last": 0.75, "names": {"elbow": "a"}}


def test_an_exciting_motion_is_asked_for_as_it_was_typed(
    asked: dict[str, Any], tmp_path: Path
) -> None:
    out = "--out", tmp_path / "a.yaml"
    typed("excite", "two_link", *out)
    (room,) = asked.pop("given")
    asked.pop("told")
    assert asked == {"period": 10.0, "harmonics": 5, "aim": "all", "attempts": 3, "seed": 0}
    assert (room.share, room.margin, room.acceleration, room.clearance) == (0.8, 0.05, inf, 0.05)
    assert room.box is None and room.given_start is None
    typed("excite", "two_link", *out, "--period", 4, "--harmonics", 7, "--aim", "masses",
          "--attempts", 2, "--seed", 9, "--share", 0.5, "--margin", 0.1, "--acceleration", 30,
          "--clearance", 0.2, "--start", "0.1 0.2", "--frame", "tip", "--frame", "elbow",
          "--box", "-1 -2 -3 1 2 3")  # fmt: skip
    (room,) = asked.pop("given")
    asked.pop("told")
    assert asked == {"period": 4.0, "harmonics": 7, "aim": "masses", "attempts": 2, "seed": 9}
    assert (room.share, room.margin, room.acceleration, room.clearance) == (0.5, 0.1, 30.0, 0.2)
    assert tuple(room.given_start) == (0.1, 0.2) and room.box.frames == ("tip", "elbow")
    assert [list(room.box.lower), list(room.box.upper)] == [[-1, -2, -3], [1, 2, 3]]


def test_a_sweep_is_asked_for_as_it_was_typed(
    asked: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    typed("sweep", "my.yaml")
    assert asked.pop("told") is not None
    assert asked == {
        "given": (Path("my.yaml"), Path("reports/sweeps/my")), "workers": None, "cluster": None
    }  # fmt: skip
    typed("sweep", "my.yaml", "--out", "there", "--workers", 3, "--cluster", "tcp://a:1")
    asked.pop("told")
    assert asked == {
        "given": (Path("my.yaml"), Path("there")), "workers": 3, "cluster": "tcp://a:1"
    }  # fmt: skip
