# SPDX-License-Identifier: Apache-2.0
"""``./arm plot``: recordings as figures."""

from __future__ import annotations

from pathlib import Path

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
