# SPDX-License-Identifier: Apache-2.0
"""The commands of ``./arm`` with their arguments and options, from the command line itself."""

from __future__ import annotations

import inspect
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import click

ROOT = Path(__file__).resolve().parents[2]


def overview() -> str:
    """What ``./arm`` prints without a command."""
    plain = {**os.environ, "ROS_DISTRO": ""}
    done = subprocess.run(
        [ROOT / "arm", "help"], capture_output=True, text=True, check=True, env=plain
    )
    return f"```text\n{done.stdout.strip()}\n```\n"


def commands() -> dict[str, click.Command]:
    """Every command of the suite by its words, commands of groups included."""
    from arm_studies.cli.main import main

    return dict(_below(main, ""))


def _below(group: click.Group, words: str) -> Iterator[tuple[str, click.Command]]:
    for name, command in group.commands.items():
        if not command.hidden:
            yield f"{words}{name}", command
            if isinstance(command, click.Group):
                yield from _below(command, f"{words}{name} ")


def markdown() -> str:
    """A section for each command."""
    return "\n".join(_section(words, command) for words, command in commands().items())


def _section(words: str, command: click.Command) -> str:
    context = click.Context(command, info_name=f"./arm {words}")
    usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
    rows = [row for parameter in command.params for row in _row(parameter, context)]
    table = ["| option | meaning |", "|---|---|", *rows] if rows else []
    examples = _plain(command.epilog)
    return "\n".join(
        [
            f"### `{words}`",
            "",
            f"```text\n{usage}\n```",
            "",
            _paragraphs(command.help),
            "",
            *table,
            "",
            f"```text\n{examples}\n```\n" if examples else "",
        ]
    )


def _row(parameter: click.Parameter, context: click.Context) -> list[str]:
    record = parameter.get_help_record(context)
    if record is None:
        return []
    option, words = (" ".join(part.replace("|", "\\|").split()) for part in record)
    return [f"| `{option}` | {words} |"]


def _plain(text: str | None) -> str:
    """Text in which click is told by a mark where not to break lines."""
    return inspect.cleandoc((text or "").replace("\b", "")).strip()


def _paragraphs(text: str | None) -> str:
    """Help as Markdown: what click leaves unbroken is a block of its own."""
    blocks = []
    for block in inspect.cleandoc(text or "").split("\n\n"):
        if block.startswith("\b"):
            blocks.append(f"```text\n{_plain(block)}\n```")
        else:
            blocks.append(block.replace("*", "\\*").replace("<", "\\<"))
    return "\n\n".join(blocks)
