# SPDX-License-Identifier: Apache-2.0
"""Options of all commands: which are flags, and their defaults and ranges, as help shows them."""

from __future__ import annotations

import re
from pathlib import Path

import click
import pytest
import yaml
from click.testing import CliRunner

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
