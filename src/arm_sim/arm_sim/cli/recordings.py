# SPDX-License-Identifier: Apache-2.0
"""``./arm record``, ``./arm replay`` and ``./arm plot``."""

from __future__ import annotations

import math
import sys
from datetime import datetime
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import click

from arm_dynamics.writing import warn_if_replaced
from arm_sim.cli.arguments import BagTopic, Figure, Json, NotNegative, Positive, RobotScene, Scene
from arm_sim.cli.command import command
from arm_sim.cli.nodes import run_node
from arm_sim.cli.output import checked, say, to_json, waiting

if TYPE_CHECKING:
    from arm_sim import Recording
    from arm_sim.replay import Replay


@command(
    "./arm plot run.mcap",
    "./arm plot run.mcap other.mcap --joint panda_joint2 --joint panda_joint4 --out both.pdf",
    "./arm plot rosbag2_of_my_robot --scene ur10",
)
def plot(
    recording: Path,
    others: Annotated[tuple[Path, ...], "[OTHER…]"] = (),
    *,
    out: Figure | None = None,
    joints: Annotated[tuple[str, ...], "--joint"] = (),
    scene: RobotScene | None = None,
    topic: BagTopic | None = None,
    show: bool = False,
) -> None:
    """Draw a RECORDING: positions, velocities, torques and the energy account.

    OTHERs are drawn over it, in other lines. A recording is a file written by the sim node's
    parameter record or by Recording.save (.mcap), a bag of a robot (.mcap, .db3 or a folder), or
    a .csv table.

    Args:
        out: Figure to write (.png, .pdf or .svg).  [default: NAME.png]
        joints: Joint to draw; may be repeated.
        show: Also open a window.
    """
    from matplotlib import pyplot

    from arm_sim import Recording
    from arm_sim.recording.figure import NO_WINDOW

    if not show:
        pyplot.switch_backend("agg")  # without a screen
    with waiting(f"reading {recording}"):
        loaded = [Recording.load(path, topic=topic) for path in (recording, *others)]
        if scene:
            loaded = [run if run.origin else run.of(scene) for run in loaded]
        figure = loaded[0].plot(*loaded[1:], joints=joints)
    out = out or Path(f"{recording.stem or recording.name}.png")
    warn_if_replaced(out)
    figure.savefig(out, dpi=150)
    say(*map(_checked_summary, loaded), out)
    if show and not figure.canvas.required_interactive_framework:
        raise click.ClickException(f"{NO_WINDOW}; the figure is in '{out}'")
    if show:
        pyplot.show()


@command(
    "./arm record",
    "./arm record /joint_states /joint_commands --out try.mcap --duration 10",
    "./arm record --repair cut.mcap --out whole.mcap",
)
def record(
    topics: Annotated[tuple[str, ...], "[TOPIC…]"] = (),
    *,
    out: Path | None = None,
    duration: Positive | None = None,
    cut: Annotated[Path | None, "--repair FILE"] = None,
) -> None:
    """Record TOPICs of a running system until Ctrl-C; all topics if none is given.

    To record every time step of a simulator with its full state, for a bit-exact replay, let the
    simulator record itself: ./arm sim SCENE --ros-args -p record:=FILE.

    Args:
        out: File (.mcap) or folder of a bag.  [default: named by the time]
        duration: How long to record, in s.
        cut: Instead, write all that is intact of a file that was cut off, or of a bag's folder.
    """
    if cut is None:
        _record(topics, out, duration or math.inf)
    elif topics or duration:
        raise click.UsageError("--repair records nothing: only --out is allowed")
    else:
        _repair(cut, out or cut.with_name(f"{cut.stem}-repaired.mcap"))


def _record(topics: tuple[str, ...], out: Path | None, duration: float) -> NoReturn:
    from arm_sim.ros.record.topics import TopicRecorder

    path = out or Path(f"recording-{datetime.now():%Y%m%d-%H%M%S}.mcap")
    end = monotonic() + duration

    def make(**kwargs: Any) -> Any:
        node = TopicRecorder(path, topics, **kwargs)
        click.echo(f"recording to {path}", err=True)
        return node

    status, node = run_node(make, until=lambda x: monotonic() > end or bool(x.thread.failure))
    if node is not None:
        _show_topics(node.count)
        for topic, lost in node.gaps.items():
            click.echo(f"{lost:9d}  missing on {topic}, by gaps between its stamps")
        for topic in node.missing:
            click.echo(f"        -  {topic}: no publisher")
        if node.thread.lost:
            click.echo(f"{node.thread.lost} messages lost: {node.thread.trouble}", err=True)
        click.echo(str(path))
        status = status or int(bool(node.thread.failure))
    sys.exit(status)


def _show_topics(count: dict[str, int]) -> None:
    for topic, messages in count.items():
        click.echo(f"{messages:9d}  {topic}")


def _repair(cut: Path, out: Path) -> None:
    from arm_sim.recording.files.repair import repair

    with waiting(f"repairing {cut}"):
        result = repair(cut, out)
    for damage in dict.fromkeys(result.damage):
        click.echo(f"{cut}: {damage}", err=True)
    _show_topics(result.count)
    click.echo(f"attachments and metadata: {', '.join(result.extras) or 'none'}")
    click.echo(str(out))


@command(
    "./arm replay run.mcap",
    "./arm replay run.mcap --integrator dop853 --tolerance 1e-10 --out exact.mcap",
    "./arm replay --topics rosbag2_of_my_robot --rate 0.5",
)
def replay(
    recording: Path,
    *,
    scene: Scene | None = None,
    check: bool = False,
    integrator: str | None = None,
    tolerance: float | None = None,
    out: Path | None = None,
    topics: bool = False,
    names: Annotated[tuple[str, ...], "--topic"] = (),
    rate: NotNegative | None = None,
    as_json: Json = False,
) -> None:
    """Run the scene of a RECORDING again from its commands, and compare every state.

    The file contains the scene, its robot, commands, parameter changes and external forces. The
    exit status is 1 if any state differs, by as little as one bit. With --check the whole motion
    is made again by another method, a finer time step and a tighter tolerance; the exit status is
    1 if its error exceeds the scene's accuracy.

    Args:
        scene: Replay with another scene that has the same joints.
        check: Estimate the error of the motion by a second run instead.
        integrator: Replay with another integration method.
        tolerance: Replay with another tolerance.
        out: Recording to save the new motion to.
        topics: Publish the recorded topics instead, at the recorded rate.
        names: With --topics: publish only this topic.
        rate: With --topics: playback speed, 1 if not given; 0: as fast as possible.
    """
    changed = scene or integrator or tolerance or out
    if check and (changed or topics):
        raise click.UsageError("--check judges the recording as it is: only --json is allowed")
    if topics and (changed or as_json):
        raise click.UsageError("--topics plays the recording unchanged: only --rate is allowed")
    if not topics and (names or rate is not None):
        option = "--topic" if names else "--rate"
        raise click.UsageError(f"{option} is allowed with --topics only")
    if topics:
        _play(recording, names, 1.0 if rate is None else rate)
    elif check:
        _check(recording, as_json)
    else:
        _compare(recording, scene, integrator, tolerance, out, as_json)


def _check(path: Path, as_json: bool) -> NoReturn:
    from arm_sim import Recording

    with waiting(f"reading {path}"):
        recording = Recording.load(path)
    summary = _checked_summary(recording)
    if as_json:
        click.echo(to_json({
            "trusted": recording.trusted, "doubt": recording.doubt,
            "error": recording.error.max(axis=0), "how": recording.second_run.how,
        }))  # fmt: skip
    else:
        say(summary)
    sys.exit(0 if recording.trusted else 1)


def _compare(
    path: Path, scene: str | None, integrator: str | None, tolerance: float | None,
    out: Path | None, as_json: bool,
) -> NoReturn:  # fmt: skip
    import numpy as np

    from arm_sim import Recording
    from arm_sim.replay import replay as replayed

    with waiting(f"replaying {path}"):
        original = Recording.load(path)
        result = replayed(original, scene, integrator, tolerance)
    summary = _checked_summary(result.recording)
    saved = () if out is None else (result.recording.save(out),)
    largest = float(np.nanmax(result.apart)) if len(result.apart) else 0.0
    if as_json:
        click.echo(to_json({
            "equal": result.equal, "ticks": len(original) - 1,
            "first_difference": None if result.first is None else str(result.first),
            "largest": largest, "failure": result.failure or None,
            "other_versions": result.other_versions, "trusted": result.recording.trusted,
        }))  # fmt: skip
    else:
        say(*_comparison(original, result, largest), summary, *saved)
    sys.exit(0 if result.equal else 1)


def _comparison(original: Recording, result: Replay, largest: float) -> list[str]:
    """What a replay has shown, in lines of text."""
    notes = [event.text for event in original.events if event.text.startswith("file: ")]
    lines = notes if result.equal else [repr(original)]  # the replayed one is shown in any case
    for name in result.other_versions:
        lines.append(f"{name} has another version here; last bits may differ")
    if result.equal:
        lines.append(f"{len(original) - 1} time steps replayed, every state bit-identical")
    if result.first is not None:
        lines.append(f"first difference: {result.first}")
        lines.append(f"positions differ by {largest:.3g} rad or m at most")
    if result.failure:
        lines.append(f"the replay ends early: {result.failure}")
    return lines


def _checked_summary(recording: Recording) -> str:
    """Summary of a recording, with the error of its motion if it can be known."""
    if recording.origin is not None and not recording.of_robot:
        checked(recording)  # the summary has it then
    return repr(recording)


def _play(path: Path, names: tuple[str, ...], rate: float) -> NoReturn:
    from arm_sim.ros.record.player import Player

    def make(**kwargs: Any) -> Any:
        player = Player(path, names, **kwargs)
        for topic, why in player.obstacles.items():
            click.echo(f"{topic} is ignored: {why}", err=True)
        click.echo(f"playing {player.duration:.6g} s", err=True)
        player.start(rate)
        return player

    status, player = run_node(make, until=lambda node: bool(node.done))
    if player is not None:
        click.echo(f"{player.count} messages published")
    sys.exit(status)
