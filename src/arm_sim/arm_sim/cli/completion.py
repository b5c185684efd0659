# SPDX-License-Identifier: Apache-2.0
"""``./arm completion``, and what a shell offers for a half-typed line."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click
from click.shell_completion import (
    BashComplete,
    CompletionItem,
    FishComplete,
    ShellComplete,
    ZshComplete,
)

from arm_dynamics.exceptions import choices
from arm_sim.cli.output import examples

VARIABLE = "_ARM_COMPLETE"
ALSO = "ARM_COMMANDS"  # commands of the script ./arm, which sets this variable


class Commands(click.Group):
    """A group that says which command was possibly meant, and completes those of ./arm."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find a command, or end with what there is."""
        if args and args[0][:1].isalpha() and self.get_command(ctx, args[0]) is None:
            known = [*self.list_commands(ctx), *self._others(ctx)]
            ctx.fail(f"no command '{args[0]}'; there are {choices(args[0], known, 60)}")
        return super().resolve_command(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Commands that begin so."""
        offered = super().shell_complete(ctx, incomplete)
        return [
            *offered,
            *(CompletionItem(x) for x in self._others(ctx) if x.startswith(incomplete)),
        ]

    def _others(self, ctx: click.Context) -> list[str]:
        return os.environ.get(ALSO, "").split() if ctx.parent is None else []


class SceneType(click.ParamType):
    """The name of a ready scene, a path, or a package:// URI; completed as such."""

    name = "scene"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Ready scenes, and the scene files and robots in this folder; else any file."""
        from arm_dynamics.scene.files import ready_scenes

        here = (path.name for path in Path.cwd().glob("*") if path.suffix in (".yaml", ".urdf"))
        names = [*ready_scenes(), *sorted(here)]
        offered = [CompletionItem(name) for name in names if name.startswith(incomplete)]
        return offered or [CompletionItem(incomplete, type="file")]


SCENE = SceneType()


class _Bash(BashComplete):
    """As click's, for ``arm`` and for every path that ends so, which bash sees to itself."""

    @staticmethod
    def _check_version() -> None:
        """Nothing to ask: the bash that will run it need not be the one on PATH."""


class _Zsh(ZshComplete):
    """As click's, but it calls what was typed: ``./arm`` need not be on PATH."""

    source_template = ZshComplete.source_template.replace(
        "%(complete_var)s=zsh_complete %(prog_name)s",
        "%(complete_var)s=zsh_complete ${words[1]}",
    )


class _Fish(FishComplete):
    """As click's, but it calls what was typed."""

    source_template = FishComplete.source_template.replace(
        "%(complete_var)s=fish_complete COMP_WORDS=(commandline -cp) "
        "COMP_CWORD=(commandline -t) %(prog_name)s",
        "%(complete_var)s=fish_complete COMP_WORDS=(commandline -cp) "
        "COMP_CWORD=(commandline -t) (commandline -opc)[1]",
    )


SHELLS: dict[str, type[ShellComplete]] = {"bash": _Bash, "zsh": _Zsh, "fish": _Fish}


@click.command(
    epilog=examples(
        "./arm completion bash > ~/.arm-completion",
        'eval "$(./arm completion bash)"',
        "./arm completion fish | source",
    )
)
@click.argument("shell", type=click.Choice(list(SHELLS)))
@click.pass_context
def completion(context: click.Context, shell: str) -> None:
    """Print what makes SHELL complete commands, options and names of scenes by Tab.

    For good, put the line into the file that the shell reads when it starts, with the path of this
    ./arm. It completes both ./arm and arm.
    """
    root: Any = context.find_root().command
    click.echo(SHELLS[shell](root, {}, "arm", VARIABLE).source())
