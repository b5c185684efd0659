# SPDX-License-Identifier: Apache-2.0
"""``./arm view``: show arms in the browser, and write pictures of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import click

from arm_sim.cli.arguments import BagTopic, File, Positive, RobotScene, Scene
from arm_sim.cli.command import command
from arm_sim.cli.output import checked, console, waiting
from arm_sim.exceptions import ViewError

if TYPE_CHECKING:
    from arm_sim import Recording, Simulator
    from arm_sim.view import View


class Size(click.ParamType):
    """Width and height in pixels: 960x600."""

    name = "WIDTHxHEIGHT"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """Parse the size, or fail with what is allowed."""
        sides = str(value).split("x")
        if len(sides) != 2 or not all(x.isdecimal() and 16 <= int(x) <= 4096 for x in sides):
            self.fail(f"{value!r}; allowed: 16x16 to 4096x4096, e.g. 960x600", param, ctx)
        width, height = map(int, sides)
        return width, height


class Pictures(NamedTuple):
    """Files to write of a page, by kind, and how: see the options of ``view``."""

    paths: dict[str, Path]
    size: tuple[int, int]
    time: float | None
    rate: float
    speed: float

    def write(self, page: View, on_progress: Callable[[str], object]) -> None:
        """Draw and write all files."""
        for kind, path in self.paths.items():
            on_progress(f"drawing {path}")
            if kind == "png":
                page.picture(path, self.size, self.time)
            elif kind == "html":
                page.page(path, self.rate, self.speed)
            else:
                page.film(path, self.size, self.rate, self.speed, on_progress)


@command(
    "./arm view panda",
    "./arm view panda ur10 --port 9000",
    "./arm view --live",
    "./arm view --live=left --live=right",
    "./arm view run.mcap",
    "./arm view bags/my_robot --scene ur10",
    "./arm view four_bar --gif four_bar.gif --duration 4",
    "./arm view my_arm.urdf --png my_arm.png --size 1200x800",
)
def view(
    what: tuple[Scene, ...] = (),
    *,
    live: Annotated[
        tuple[str, ...], "--live [NAMESPACE]", {"is_flag": False, "flag_value": ""}
    ] = (),
    host: str = "127.0.0.1",
    port: Annotated[int | None, click.IntRange(0, 65535)] = None,
    html: File | None = None,
    png: File | None = None,
    gif: File | None = None,
    mp4: File | None = None,
    size: Annotated[tuple[int, int] | None, Size()] = None,
    time: float | None = None,
    duration: Positive = 5.0,
    control: Literal["nothing", "weight"] = "nothing",
    scene: RobotScene | None = None,
    topic: BagTopic | None = None,
    speed: Annotated[float, click.FloatRange(0.01, 100.0)] = 1.0,
    rate: Annotated[float, click.FloatRange(1.0, 60.0)] = 25.0,
) -> None:
    """Show WHAT in the browser until Ctrl-C, or write its pictures.

    WHAT is a scene (a scene file, a URDF, or the name of a bundled scene) that can be run,
    stepped, placed, pushed and pulled with the mouse; or a recording to play: a file written by
    the sim node's parameter record or by Recording.save, a bag of a robot, or a .csv table.
    Several are shown side by side.

    Args:
        live: Follow a running robot over its topics, in a namespace by --live=NAMESPACE. WHAT is
            then its scene, and may be omitted where robot_description is published.
        host: Address to listen on; 0.0.0.0 for the whole network.
        port: Port; 8080 or the next free one when omitted.
        html: Write a standalone page that plays without a server.
        png: Write a picture, drawn by a headless browser.
        gif: Write an animated GIF.
        mp4: Write a video; needs ffmpeg.
        size: Size of pictures; 960x600 by default.
        time: Time of the picture of --png, in s.
        duration: Length of films and pages of a scene, in s.
        control: For scenes: what holds the arm in pictures and pages; weight: its weight is
            carried.
        speed: Speed of films and pages.
        rate: Frames per second of films and pages.
    """
    from arm_sim.cli.interrupts import interruptible

    if not (live or what):
        raise click.UsageError("a scene, a recording, or --live for a running robot is expected")
    files = {"png": png, "gif": gif, "mp4": mp4, "html": html}
    paths = {kind: path for kind, path in files.items() if path is not None}
    port = 0 if paths else port
    progress = [f"opening {' '.join(what) or 'the page'}"]
    with ExitStack() as stack:
        with waiting(lambda: progress[-1], in_lines=True):
            from arm_sim.view.page import SIZE
            from arm_sim.view.pictures import browser
            from arm_sim.view.server import library

            if paths.keys() - {"html"}:
                browser()  # or an error, before anything is computed
            library()
            if live:
                from arm_sim.cli.robot.listener import Listener
                from arm_sim.cli.view.live import follower_page

                page = follower_page(stack.enter_context(Listener()), live, what, host, port)
            else:
                motion = Motion(duration, control) if paths else None
                page = page_of(what, host, port, motion, scene, topic, progress.append)
            stack.enter_context(page)
            if paths:
                Pictures(paths, size or SIZE, time, rate, speed).write(page, progress.append)
        if not paths:
            click.echo(f"{page.url}  (Ctrl-C ends)")
            with suppress(KeyboardInterrupt), interruptible():
                page.wait()
    for path in paths.values():
        click.echo(path)


class Motion(NamedTuple):
    """How a scene moves in pictures."""

    duration: float  # [s]
    control: Literal["nothing", "weight"]  # weight: its weight is carried


def page_of(
    sources: Sequence[str], host: str, port: int | None, motion: Motion | None = None,
    scene: str | None = None, topic: str | None = None,
    on_progress: Callable[[str], object] = lambda text: None,
) -> View:  # fmt: skip
    """A page of scenes, which move if ``motion`` is given, or of recordings."""
    from arm_sim.view import show
    from arm_sim.view.view import is_recording

    first = scene or sources[0]  # meshes with relative names are in the folder of its file
    folder = Path(first).parent if Path(first).is_file() else Path.cwd()
    recorded = [source for source in sources if is_recording(source) or Path(source).is_dir()]
    if recorded and len(recorded) < len(sources):
        simulated = next(source for source in sources if source not in recorded)
        raise ViewError(
            f"'{recorded[0]}' is a recording and '{simulated}' is not; allowed: several arguments "
            "of one kind"
        )
    actors = [
        _recording(source, scene, topic) if recorded else _simulated(source, motion, on_progress)
        for source in sources
    ]
    on_progress("drawing the page")
    names = [Path(source).stem for source in sources]
    return show(*actors, name=names, host=host, port=port, folder=folder)


def _recording(source: str, scene: str | None, topic: str | None) -> Recording:
    from arm_sim import Recording

    recording = Recording.load(source, topic=topic)
    if recording.scene is not None:
        return recording
    if scene is None:
        raise ViewError(f"'{source}' contains no scene, so its arm is unknown; name it by --scene")
    return recording.of(scene)


def _simulated(
    source: str, motion: Motion | None, on_progress: Callable[[str], object]
) -> Recording | Simulator:
    """A simulator of a scene, or the recording of its motion."""
    from arm_dynamics.control import GravityCompensation
    from arm_sim.view.view import simulator_of

    simulator = simulator_of(source)
    if motion is None:
        return simulator
    on_progress(f"simulating {source}")
    weight = GravityCompensation(simulator.dynamics)
    run = simulator.run(motion.duration, weight.torque if motion.control == "weight" else None)
    console().print(checked(run), markup=False)
    return run
