# SPDX-License-Identifier: Apache-2.0
"""The command group of the suite."""

import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import IO, Any

import click

from arm_dynamics.exceptions import ArmError
from arm_sim import __version__
from arm_sim.cli.build import build
from arm_sim.cli.call import call
from arm_sim.cli.completion import Commands, completion
from arm_sim.cli.demo import demo
from arm_sim.cli.describe import describe
from arm_sim.cli.export import export
from arm_sim.cli.interrupts import handle_in_command, interrupted
from arm_sim.cli.nodes import controller, dynamics, sim
from arm_sim.cli.output import as_called, examples, print_anything, progress_on_stderr
from arm_sim.cli.recordings import plot, record, replay
from arm_sim.cli.robot import get, go, set_, watch
from arm_sim.cli.urdf import urdf
from arm_sim.cli.view import view

# The commands of the simulator by subject, as the help of the script ./arm lists them
SECTIONS = {
    "Demo": (demo,),
    "Nodes": (sim, dynamics, controller),
    "A running arm": (go, set_, get, watch, call),
    "Scenes": (describe, urdf, build, export, view),
    "Recordings": (record, replay, plot),
    "Shell": (completion,),
}


class Suite(Commands):
    """A group whose commands report errors of the suite as one line.

    Args:
        sections: Its commands by subject.
    """

    def __init__(self, sections: Mapping[str, Sequence[click.Command]], **settings: Any) -> None:
        commands = [command for section in sections.values() for command in section]
        super().__init__(commands=commands, **settings)
        self._sections = sections

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands by subject, each with its first sentence in full."""
        for title, commands in self._sections.items():
            with formatter.section(title):
                rows = [(str(x.name), x.get_short_help_str(limit=1000)) for x in commands]
                formatter.write_dl(rows)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the group's own options."""
        with _spelled_as_by_nodes():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; errors of the suite become a message and exit status 1."""
        handle_in_command()
        print_anything()
        with _spelled_as_by_nodes():
            try:
                with progress_on_stderr():
                    return super().invoke(ctx)
            except ImportError as error:
                if interrupted:
                    raise click.Abort from None
                package = str(error.name).split(".")[0]
                if not (isinstance(error, ModuleNotFoundError) and _OF_ROS.fullmatch(package)):
                    raise
                raise click.ClickException(
                    f"Python cannot find the module '{error.name}': this command needs ROS 2 "
                    "Jazzy or Kilted and the built workspace; the script arm of the project's "
                    "folder sets both up, or source the workspace's install/setup.bash"
                ) from error
            except OSError as error:
                subject = f"'{error.filename}'" if error.filename else "the output"
                message = f"{subject}: {error.strerror}" if error.strerror else str(error)
                raise click.ClickException(message) from error
            except ArmError as error:
                raise click.ClickException(str(error)) from None


@contextmanager
def _spelled_as_by_nodes() -> Iterator[None]:
    """Errors are printed as ``error: …``, with the command as it is called here."""

    def show(error: click.ClickException, file: IO[Any] | None = None) -> None:
        shown_by_click = io.StringIO()
        type(error).show(error, shown_by_click)
        text = as_called(shown_by_click.getvalue())
        click.echo(re.sub("(?m)^Error: ", "error: ", text, count=1), file, nl=False, err=True)

    try:
        yield
    except click.ClickException as error:
        error.show = partial(show, error)  # type: ignore[method-assign]
        raise


_OF_ROS = re.compile(r"rclpy|ament_\w+|rosidl_\w+|rpyutils|\w+_(msgs|srvs|interfaces)")


def suite(
    sections: Mapping[str, Sequence[click.Command]], compiled: Sequence[Callable[..., Any]] = ()
) -> Suite:
    """The command ``arm`` with these commands.

    Args:
        sections: Commands by subject.
        compiled: What ``build --derivatives`` compiles besides, as parts of a simulator by name.
    """
    group = Suite(
        sections, name="arm", help="Dynamics, simulation and control of robot arms on ROS 2.",
        epilog=examples("./arm demo", "./arm describe panda"),
        context_settings={
            "help_option_names": ["-h", "--help"], "max_content_width": 100, "obj": compiled
        },
    )  # fmt: skip
    return click.version_option(__version__, message="%(version)s")(group)


main = suite(SECTIONS)
