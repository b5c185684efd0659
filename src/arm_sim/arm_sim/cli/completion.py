# SPDX-License-Identifier: Apache-2.0
"""``./arm completion``, and the completions that a shell offers."""

import os
from pathlib import Path
from typing import Annotated, Any

import click
from click import shell_completion
from click.shell_completion import CompletionItem

from arm_dynamics.exceptions import choices
from arm_sim.cli.command import command
from arm_sim.cli.output import as_called

VARIABLE = "_ARM_COMPLETE"
OF_SCRIPT = "ARM_COMMANDS"  # set by the script ./arm to its own commands
OF_CLONE = "bench compare-controllers docs lint python setup stress test"


class Commands(click.Group):
    """A group that suggests similar commands, and completes those of ./arm."""

    def __init__(self, help: str = "", **settings: Any) -> None:
        super().__init__(help=as_called(help), **settings)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the group's own options, or say which commands have an unknown one."""
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            owners = [
                name
                for name, one in sorted(self.commands.items())
                if any(error.option_name in parameter.opts for parameter in one.params)
            ]
            if not owners:
                raise
            ctx.fail(f"option '{error.option_name}' goes behind its command: {', '.join(owners)}")

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find a command, or fail with a list of the commands."""
        if args and args[0][:1].isalpha() and args[0] not in self.commands:
            if args[0] in OF_CLONE.split():
                ctx.fail(f"'{args[0]}' needs a clone of the repository: there, bash arm {args[0]}")
            names = [*self.list_commands(ctx), *self._of_script(ctx)]
            ctx.fail(f"unknown command '{args[0]}'; allowed: {choices(args[0], names, 60)}")
        return super().resolve_command(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Commands with this prefix."""
        names = [CompletionItem(x) for x in self._of_script(ctx) if x.startswith(incomplete)]
        return super().shell_complete(ctx, incomplete) + names

    def _of_script(self, ctx: click.Context) -> list[str]:
        return os.environ.get(OF_SCRIPT, "").split() if ctx.parent is None else []


class SceneType(click.ParamType):
    """The name of a bundled scene, a path, or a package:// URI; completed as such."""

    name = "scene"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Bundled scenes, and scene files and URDFs in this folder; else any file."""
        from arm_dynamics.scene.files import ready_scenes

        files = (path.name for path in Path.cwd().glob("*") if path.suffix in (".yaml", ".urdf"))
        names = [*ready_scenes(), *sorted(files)]
        matches = [CompletionItem(name) for name in names if name.startswith(incomplete)]
        return matches or [CompletionItem(incomplete, type="file")]


SCENE = SceneType()


class _Bash(shell_completion.BashComplete):
    """As click's, for ``arm`` and, handled by bash, for every path that ends in it."""

    @staticmethod
    def _check_version() -> None:
        """Skip the check: the bash that runs the completion need not be the one on PATH."""


class _Zsh(shell_completion.ZshComplete):
    """As click's, but it calls the typed path: ``./arm`` need not be on PATH."""

    source_template = shell_completion.ZshComplete.source_template.replace(
        "%(complete_var)s=zsh_complete %(prog_name)s", "%(complete_var)s=zsh_complete ${words[1]}"
    )


class _Fish(shell_completion.FishComplete):
    """As click's, but it calls the typed path."""

    source_template = shell_completion.FishComplete.source_template.replace(
        "(commandline -t) %(prog_name)s", "(commandline -t) (commandline -opc)[1]"
    )


SHELLS = {"bash": _Bash, "zsh": _Zsh, "fish": _Fish}


@command(
    "./arm completion bash > ~/.arm-completion",
    'eval "$(./arm completion bash)"',
    "./arm completion fish | source",
)
def completion(shell: Annotated[str, click.Choice(list(SHELLS))]) -> None:
    """Print a script that makes SHELL complete commands, options and names of scenes by Tab.

    To enable it permanently, add the line below to the start-up file of the shell, with the path
    of the command. It completes every command called arm.
    """
    root: Any = click.get_current_context().find_root().command
    click.echo(SHELLS[shell](root, {}, "arm", VARIABLE).source())
