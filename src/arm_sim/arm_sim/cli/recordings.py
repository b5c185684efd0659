# SPDX-License-Identifier: Apache-2.0
"""``./arm record``, ``./arm replay`` and ``./arm plot``."""

from __future__ import annotations

import json
import sys
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from arm_dynamics.exceptions import choices
from arm_dynamics.writing import warn_if_replaced
from arm_sim.cli.completion import SCENE
from arm_sim.cli.output import checked, console, examples, waiting

if TYPE_CHECKING:
    from arm_sim import Recording
    from arm_sim.replay import Replay

_PATH = click.Path(path_type=Path)
FIGURES = (".png", ".pdf", ".svg", ".jpg")


@click.command(
    epilog=examples(
        "./arm plot run.mcap",
        "./arm plot run.mcap other.mcap --joint panda_joint2 --joint panda_joint4 --out both.pdf",
        "./arm plot rosbag2_of_my_robot --scene ur10",
    )
)
@click.argument("recording", type=_PATH)
@click.argument("others", type=_PATH, nargs=-1, metavar="[OTHER…]")
@click.option(
    "--out", type=_PATH, help="Figure to write (.png, .pdf or .svg).  [default: NAME.png]"
)
@click.option("--joint", "joints", multiple=True, help="Joint to draw; may be repeated.")
@click.option("--scene", type=SCENE, help="Scene, for a recording of a robot, which has none.")
@click.option("--topic", help="Topic of the joint states, if a bag has several.")
@click.option("--show", is_flag=True, help="Also open a window.")
def plot(
    recording: Path, others: tuple[Path, ...], out: Path | None, joints: tuple[str, ...],
    scene: str | None, topic: str | None, show: bool,
) -> None:  # fmt: skip
    """Draw a RECORDING: positions, velocities, torques and the energy account.

    OTHERs are drawn over it, dashed. A recording is a file written by the sim node's parameter
    record or by Recording.save (.mcap), a bag of a robot (.mcap, .db3 or a folder), or a
    .csv table.
    """
    from matplotlib import pyplot

    from arm_sim import Recording
    from arm_sim.recording.figure import NO_WINDOW

    if out is not None and out.suffix not in FIGURES:
        raise click.ClickException(
            f"'{out}' ends in '{out.suffix}'; allowed: {choices(out.suffix, FIGURES)}"
        )
    if not show:
        pyplot.switch_backend("agg")  # without a screen
    with waiting(f"reading {recording}"):
        loaded = [Recording.load(path, topic=topic) for path in (recording, *others)]
        if scene:
            loaded = [made if made.origin else made.of(scene) for made in loaded]
        figure = loaded[0].plot(*loaded[1:], joints=joints)
    out = out or Path(f"{recording.stem or recording.name}.png")
    warn_if_replaced(out)
    figure.savefig(out, dpi=150)
    for made in loaded:
        console().print(_checked(made), markup=False)
    console().print(f"{out}", markup=False)
    if show and not figure.canvas.required_interactive_framework:
        raise click.ClickException(f"{NO_WINDOW}; the figure is in '{out}'")
    if show:
        pyplot.show()


@click.command(
    epilog=examples(
        "./arm record",
        "./arm record /joint_states /joint_commands --out try.mcap --duration 10",
        "./arm record --repair cut.mcap --out whole.mcap",
    )
)
@click.argument("topics", nargs=-1, metavar="[TOPIC…]")
@click.option(
    "--out", type=_PATH, help="File (.mcap) or folder of a bag.  [default: named by the time]"
)
@click.option(
    "--duration", type=click.FloatRange(min=0.0, min_open=True), help="How long to record, in s."
)
@click.option(
    "--repair", "cut", type=_PATH, metavar="FILE",
    help="Instead, write all that is intact of a file that was cut off, or of a bag's folder.",
)  # fmt: skip
def record(
    topics: tuple[str, ...], out: Path | None, duration: float | None, cut: Path | None
) -> None:
    """Record TOPICs of a running system until Ctrl-C; all topics if none is given.

    To record every tick of a simulator with its full state, for a bit-exact replay, let the
    simulator record itself: ./arm sim SCENE --ros-args -p record:=FILE.
    """
    if cut is not None:
        if topics or duration:
            raise click.UsageError("--repair records nothing: only --out is allowed")
        _repair(cut, out or cut.with_name(f"{cut.stem}-repaired.mcap"))
        return
    from time import monotonic

    from arm_sim.ros.record.topics import TopicRecorder

    path = out or Path(f"recording-{datetime.now():%Y%m%d-%H%M%S}.mcap")
    end = None if duration is None else monotonic() + duration
    nodes: list[Any] = []

    def make(**kwargs: Any) -> Any:
        nodes.append(TopicRecorder(path, topics, **kwargs))
        click.echo(f"recording to {path}", err=True)
        return nodes[0]

    def done() -> bool:
        return (end is not None and monotonic() > end) or any(n.thread.failure for n in nodes)

    status = _run_node(make, done)
    for node in nodes:
        _show_topics(node.count)
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
        found = repair(cut, out)
    for damage in dict.fromkeys(found.damage):
        click.echo(f"{cut}: {damage}", err=True)
    _show_topics(found.count)
    click.echo(f"attachments and metadata: {', '.join(found.kept) or 'none'}")
    click.echo(str(out))


@click.command(
    epilog=examples(
        "./arm replay run.mcap",
        "./arm replay run.mcap --integrator dop853 --tolerance 1e-10 --out exact.mcap",
        "./arm replay --topics rosbag2_of_my_robot --rate 0.5",
    )
)
@click.argument("recording", type=_PATH)
@click.option("--scene", type=SCENE, help="Replay with another scene that has the same joints.")
@click.option(
    "--check", is_flag=True, help="Estimate the error of the motion by a second run instead."
)
@click.option("--integrator", help="Replay with another integration method.")
@click.option("--tolerance", type=float, help="Replay with another tolerance.")
@click.option("--out", type=_PATH, help="Recording to save the new motion to.")
@click.option(
    "--topics", is_flag=True, help="Publish the recorded topics instead, at the recorded rate."
)
@click.option("--topic", "names", multiple=True, help="With --topics: publish only this topic.")
@click.option(
    "--rate",
    type=click.FloatRange(min=0.0),
    help="With --topics: playback speed, 1 if not given; 0: as fast as possible.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def replay(
    recording: Path, scene: str | None, check: bool, integrator: str | None,
    tolerance: float | None, out: Path | None, topics: bool, names: tuple[str, ...],
    rate: float | None, as_json: bool,
) -> None:  # fmt: skip
    """Run the scene of a RECORDING again from its commands, and compare every state.

    The file contains the scene, its robot, commands, parameter changes and external forces. The
    exit status is 1 if any state differs, by as little as one bit. With --check the whole motion
    is made again by another method, a finer tick and a tighter tolerance; the exit status is 1 if
    its error exceeds the scene's accuracy.
    """
    if check and (scene or integrator or tolerance or out or topics):
        raise click.UsageError("--check judges the recording as it is: only --json is allowed")
    if topics:
        if scene or integrator or tolerance or out or as_json:
            raise click.UsageError(
                "--topics plays the recording unchanged: only --rate is allowed"
            )
        _play(recording, names, 1.0 if rate is None else rate)
        return
    if names or rate is not None:
        which = "--topic" if names else "--rate"
        raise click.UsageError(f"{which} is allowed with --topics only")
    from arm_sim import Recording
    from arm_sim.replay import replay as again

    with waiting(f"replaying {recording}"):
        loaded = Recording.load(recording)
        if not check:
            found = again(loaded, scene, integrator, tolerance)
    if check:
        _judge(loaded, as_json)
    if as_json:
        if out is not None:
            found.recording.save(out)
        click.echo(json.dumps(_facts(loaded, found)))
        sys.exit(0 if found.equal else 1)
    _show_replay(loaded, found)
    if out is not None:
        console().print(str(found.recording.save(out)), markup=False)
    sys.exit(0 if found.equal else 1)


def _checked(recording: Recording) -> str:
    """Summary of a recording, with the error of its motion if it can be known."""
    if recording.origin is not None and not recording.of_robot:
        checked(recording)  # the summary has it then
    return repr(recording)


def _judge(recording: Recording, as_json: bool) -> NoReturn:
    """Print what a second run says of a recorded motion, and end."""
    import numpy as np

    text = _checked(recording)
    if as_json:
        error = np.asarray(recording.error).max(axis=0).tolist()
        facts = {"trusted": recording.trusted, "doubt": recording.doubt, "error": error}
        click.echo(json.dumps(facts | {"how": recording.second_run.how}))
    else:
        console().print(text, markup=False)
    sys.exit(0 if recording.trusted else 1)


def _show_replay(recording: Recording, found: Replay) -> None:
    screen = console()
    screen.print(repr(recording), markup=False)
    for name in found.other_versions:
        screen.print(f"{name} has another version here; last bits may differ", markup=False)
    if found.equal:
        screen.print(f"{len(recording) - 1} time steps replayed, every state bit-identical")
    if found.first is not None:
        screen.print(f"first difference: {found.first}", markup=False)
        screen.print(f"positions differ by {_largest(found.apart):.3g} rad or m at most")
    screen.print(_checked(found.recording), markup=False)
    if found.failure:
        screen.print(f"the replay ends early: {found.failure}", markup=False)


def _facts(loaded: Recording, found: Replay) -> dict[str, Any]:
    """The result of a replay, for scripts."""
    return {
        "equal": found.equal, "ticks": len(loaded) - 1,
        "first_difference": None if found.first is None else str(found.first),
        "largest": _largest(found.apart), "failure": found.failure or None,
        "other_versions": list(found.other_versions), "trusted": found.recording.trusted,
    }  # fmt: skip


def _largest(apart: Any) -> float:
    import numpy as np

    return float(np.nanmax(apart)) if len(apart) else 0.0


def _play(path: Path, names: tuple[str, ...], rate: float) -> None:
    from arm_sim.ros.record.player import Player

    players: list[Any] = []

    def make(**kwargs: Any) -> Any:
        players.append(Player(path, names, **kwargs))
        for topic, why in players[0].passed_over.items():
            click.echo(f"{topic} is ignored: {why}", err=True)
        click.echo(f"playing {players[0].duration:.6g} s", err=True)
        players[0].start(rate)
        return players[0]

    status = _run_node(make, lambda: bool(players[0].done))
    for player in players:
        click.echo(f"{player.published} messages published")
    sys.exit(status)


def _run_node(make: Any, done: Any) -> int:
    from arm_dynamics.ros.common.executor import run

    return run(make, [], done)
