# SPDX-License-Identifier: Apache-2.0
"""``./arm view``: show arms in the browser, and write pictures of them."""

from __future__ import annotations

from contextlib import ExitStack, suppress
from pathlib import Path

import click

from arm_sim.cli.completion import SCENE
from arm_sim.cli.output import examples, waiting

__all__ = ["view"]

FILE = click.Path(dir_okay=False, path_type=Path)


class Size(click.ParamType):
    """Width and height in pixels: 960x600."""

    name = "WIDTHxHEIGHT"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """Parse the size, or fail with what is allowed."""
        if isinstance(value, tuple):
            return value
        width, _, height = str(value).partition("x")
        if not (width.isdecimal() and height.isdecimal()) or not (
            16 <= int(width) <= 4096 and 16 <= int(height) <= 4096
        ):
            self.fail(f"{value!r}; allowed: 16x16 to 4096x4096, e.g. 960x600", param, ctx)
        return int(width), int(height)


@click.command(
    epilog=examples(
        "./arm view panda",
        "./arm view panda ur10 --port 9000",
        "./arm view --live",
        "./arm view --live=left --live=right",
        "./arm view run.mcap",
        "./arm view bags/my_robot --scene ur10",
        "./arm view four_bar --gif four_bar.gif --duration 4",
        "./arm view my_arm.urdf --png my_arm.png --size 1200x800",
    )
)
@click.argument("what", type=SCENE, nargs=-1)
@click.option("--live", is_flag=False, flag_value="", multiple=True, metavar="[NAMESPACE]",
              help="Follow a running robot over its topics, in a namespace by --live=NAMESPACE. "
              "WHAT is then its scene, and may be omitted where robot_description is published.",
)  # fmt: skip
@click.option("--host", default="127.0.0.1", show_default=True,
              help="Address to listen on; 0.0.0.0 for the whole network.")  # fmt: skip
@click.option("--port", type=click.IntRange(0, 65535),
              help="Port; 8080 or the next free one when omitted.")  # fmt: skip
@click.option("--html", type=FILE, help="Write a standalone page that plays without a server.")
@click.option("--png", type=FILE, help="Write a picture, drawn by a headless browser.")
@click.option("--gif", type=FILE, help="Write an animated GIF.")
@click.option("--mp4", type=FILE, help="Write a video; needs ffmpeg.")
@click.option(
    "--size", type=Size(), default=(960, 600), help="Size of pictures; 960x600 by default."
)
@click.option("--time", type=float, help="Time of the picture of --png, in s.")
@click.option("--duration", type=click.FloatRange(0.0, min_open=True), default=5.0,
              show_default=True, help="Length of films and pages of a scene, in s.")  # fmt: skip
@click.option("--control", type=click.Choice(["nothing", "weight"]), default="nothing",
              show_default=True,
              help="For scenes: what holds the arm in pictures and pages; weight: its weight is "
              "carried.")  # fmt: skip
@click.option("--scene", type=SCENE, help="Scene, for a recording of a robot, which has none.")
@click.option("--topic", help="Topic of the joint states, if a bag has several.")
@click.option("--speed", type=click.FloatRange(0.01, 100.0), default=1.0, show_default=True,
              help="Speed of films and pages.")  # fmt: skip
@click.option("--rate", type=click.FloatRange(1.0, 60.0), default=25.0, show_default=True,
              help="Frames per second of films and pages.")  # fmt: skip
def view(
    what: tuple[str, ...], live: tuple[str, ...], host: str, port: int | None, html: Path | None,
    png: Path | None, gif: Path | None, mp4: Path | None, size: tuple[int, int],
    time: float | None, duration: float, control: str, scene: str | None, topic: str | None,
    speed: float, rate: float,
) -> None:  # fmt: skip
    """Show WHAT in the browser until Ctrl-C, or write its pictures.

    WHAT is a scene (a scene file, a URDF, or the name of a ready scene) that can be run, stepped,
    placed, pushed and pulled with the mouse; or a recording to play: a file written by the sim
    node's parameter record or by Recording.save, a bag of a robot, or a .csv table. Several are
    shown side by side.
    """
    from arm_sim.cli.interrupts import interruptible
    from arm_sim.view.pictures import browser
    from arm_sim.view.server import library

    written = {"png": png, "gif": gif, "mp4": mp4, "html": html}
    pictures = {kind: path for kind, path in written.items() if path is not None}
    if pictures.keys() - {"html"}:
        browser()
    port = 0 if pictures else port
    doing = [f"opening {' '.join(what) or 'the page'}"]
    with ExitStack() as stack:
        if pictures:
            stack.enter_context(waiting(lambda: doing[-1], in_lines=True))
        if live:
            from arm_sim.cli.robot.listener import Listener
            from arm_sim.cli.view.live import followed

            library()
            page = followed(stack.enter_context(Listener()), live, what, host, port)
        elif what:
            from arm_sim.cli.view.sources import shown

            library()  # before anything is computed
            motion = (duration, control) if pictures else None
            page = shown(what, host, port, motion, scene, topic)
        else:
            raise click.UsageError(
                "a scene, a recording, or --live for a running robot is expected"
            )
        stack.enter_context(page)
        for kind, path in pictures.items():
            doing.append(f"drawing {path}")
            if kind == "png":
                page.picture(path, size, time)
            elif kind == "html":
                page.page(path, rate, speed)
            else:
                page.film(path, size, rate, speed, doing.append)
        if not pictures:
            click.echo(f"{page.url}  (Ctrl-C ends)")
            with suppress(KeyboardInterrupt), interruptible():
                page.wait()
    for path in pictures.values():
        click.echo(path)
