# SPDX-License-Identifier: Apache-2.0
"""``./arm record``, ``./arm replay`` and ``./arm plot``."""

from __future__ import annotations

import sys
from datetime import datetime
from pathlib import Path
from typing import Any

import click

from arm_sim.cli.output import console, examples

_PATH = click.Path(path_type=Path)


@click.command(
    epilog=examples(
        "./arm plot run.mcap",
        "./arm plot run.mcap other.npz --joint panda_joint2 --joint panda_joint4 --out both.pdf",
        "./arm plot rosbag2_of_my_robot --scene ur10",
    )
)
@click.argument("recording", type=_PATH)
@click.argument("others", type=_PATH, nargs=-1, metavar="[OTHER…]")
@click.option("--out", type=_PATH, help="The figure; .png, .pdf or .svg.  [default: NAME.png]")
@click.option("--joint", "joints", multiple=True, help="Only this one; may be given again.")
@click.option("--scene", help="For recordings of a robot, which bring none.")
@click.option("--topic", help="Of the joint states, where a bag has several.")
@click.option("--show", is_flag=True, help="Open a window too.")
def plot(
    recording: Path, others: tuple[Path, ...], out: Path | None, joints: tuple[str, ...],
    scene: str | None, topic: str | None, show: bool,
) -> None:  # fmt: skip
    """Draw a RECORDING: positions, velocities, torques and the energy account.

    OTHERs are laid over it, dashed. A recording is a file of the sim's parameter record or of
    Recording.save (.mcap, .npz), a bag of a robot (.mcap, .db3 or a folder), or a .csv.
    """
    from matplotlib import pyplot

    from arm_sim import Recording

    if not show:
        pyplot.switch_backend("agg")  # where there is no screen
    loaded = [Recording.load(path, topic=topic) for path in (recording, *others)]
    if scene:
        loaded = [made if made.origin else made.of(scene) for made in loaded]
    figure = loaded[0].plot(*loaded[1:], joints=joints)
    out = out or Path(f"{recording.stem or recording.name}.png")
    try:
        figure.savefig(out, dpi=150)
    except ValueError as error:
        raise click.ClickException(f"'{out}': {error}") from None
    for made in loaded:
        console().print(repr(made), markup=False)
    console().print(f"{out}", markup=False)
    if show:
        pyplot.show()


@click.command(
    epilog=examples(
        "./arm record",
        "./arm record /joint_states /joint_commands --out try.mcap --duration 10",
    )
)
@click.argument("topics", nargs=-1, metavar="[TOPIC…]")
@click.option("--out", type=_PATH, help="File (.mcap) or folder of a bag.  [default: by the time]")
@click.option("--duration", type=click.FloatRange(min=0.0, min_open=True), help="In seconds.")
def record(topics: tuple[str, ...], out: Path | None, duration: float | None) -> None:
    """Record TOPICs of a running system until Ctrl-C, all of them if none is named.

    Every tick of a simulator with its whole state, from which it can be replayed to the bit, is
    recorded by the simulator itself: ./arm sim SCENE --ros-args -p record:=FILE.
    """
    from time import monotonic

    from arm_sim.ros.record.topics import TopicRecorder

    path = out or Path(f"recording-{datetime.now():%Y%m%d-%H%M%S}.mcap")
    end = None if duration is None else monotonic() + duration
    nodes: list[Any] = []

    def make(**kwargs: Any) -> Any:
        nodes.append(TopicRecorder(path, topics, **kwargs))
        click.echo(f"recording to {path}", err=True)
        return nodes[0]

    status = _run_node(make, lambda: end is not None and monotonic() > end)
    for node in nodes:
        for topic, count in node.count.items():
            click.echo(f"{count:9d}  {topic}")
        for topic in node.missing:
            click.echo(f"        -  {topic}: nobody publishes it")
        if node.thread.lost:
            click.echo(f"{node.thread.lost} messages lost: the disk could not follow", err=True)
        click.echo(str(path))
        status = status or int(bool(node.thread.failure))
    sys.exit(status)


@click.command(
    epilog=examples(
        "./arm replay run.mcap",
        "./arm replay run.mcap --integrator dop853 --tolerance 1e-10 --out exact.npz",
        "./arm replay --topics rosbag2_of_my_robot --rate 0.5",
    )
)
@click.argument("recording", type=_PATH)
@click.option("--scene", help="Another scene with the same joints.")
@click.option("--integrator", help="Another method.")
@click.option("--tolerance", type=float, help="Another tolerance.")
@click.option("--out", type=_PATH, help="Keep the motion as it came out this time.")
@click.option("--topics", is_flag=True, help="Play it into topics instead, in its own time.")
@click.option("--topic", "names", multiple=True, help="With --topics: only this one.")
@click.option(
    "--rate",
    type=click.FloatRange(min=0.0),
    default=1.0,
    show_default=True,
    help="With --topics: recorded time per time of the clock; 0: as fast as possible.",
)
def replay(
    recording: Path, scene: str | None, integrator: str | None, tolerance: float | None,
    out: Path | None, topics: bool, names: tuple[str, ...], rate: float,
) -> None:  # fmt: skip
    """Run the scene of a RECORDING again from its commands, and compare every state.

    The scene, its robot, commands, changes and pushes are in the file. The exit status is 1 if a
    state is another one, by as little as a bit.
    """
    if topics:
        if scene or integrator or tolerance or out:
            raise click.UsageError("--topics plays what is there; no other option but --rate")
        _play(recording, names, rate)
        return
    if names:
        raise click.UsageError("--topic belongs to --topics")
    from arm_sim import Recording
    from arm_sim.replay import replay as again

    loaded = Recording.load(recording)
    found = again(loaded, scene, integrator, tolerance)
    screen = console()
    screen.print(repr(loaded), markup=False)
    for name in found.other_versions:
        screen.print(f"{name} is of another version here; last bits may differ", markup=False)
    if found.equal:
        screen.print(f"{len(loaded) - 1} ticks replayed, every state equal to the bit")
    if found.first is not None:
        screen.print(f"first difference: {found.first}", markup=False)
        screen.print(f"positions are apart by {_largest(found.apart):.3g} rad or m at most")
    if found.failure:
        screen.print(f"the replay ends early: {found.failure}", markup=False)
    if out is not None:
        screen.print(str(found.recording.save(out)), markup=False)
    sys.exit(0 if found.equal else 1)


def _largest(apart: Any) -> float:
    import numpy as np

    return float(np.nanmax(apart)) if len(apart) else 0.0


def _play(path: Path, names: tuple[str, ...], rate: float) -> None:
    from arm_sim.ros.record.player import Player

    players: list[Any] = []

    def make(**kwargs: Any) -> Any:
        players.append(Player(path, names, **kwargs))
        for topic, why in players[0].passed_over.items():
            click.echo(f"{topic} is passed over: {why}", err=True)
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
