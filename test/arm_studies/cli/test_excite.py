# SPDX-License-Identifier: Apache-2.0
"""The command ``./arm excite``."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from pictures import written

from arm_dynamics import Dynamics
from arm_dynamics.trajectory import JointTrajectory, Waypoint, quintic
from arm_studies.cli.main import main
from arm_studies.identification.excitation import Room
from arm_studies.identification.figures import draw_excitation


def typed(*words: str) -> Result:
    return CliRunner().invoke(main, ["excite", *words], env={"COLUMNS": "160"})


QUICK = ("--period", "3", "--harmonics", "3", "--attempts", "1", "--acceleration", "20")


def test_a_motion_is_found_written_and_drawn(tmp_path: Path) -> None:
    out = tmp_path / "motion.yaml"
    done = typed("two_link", "--out", str(out), "--turns", "2", "--json", *QUICK)
    told = json.loads(done.stdout)
    assert told["parameters"] == 13 and told["duration"] == 3.0
    assert (tmp_path / "motion.png").stat().st_size > 10_000
    motion = JointTrajectory.load(out).motion(Dynamics("two_link").joint_names)
    assert motion.duration == pytest.approx(6.0)
    for t in np.linspace(0.0, 3.0, 31):
        first, again = motion.sample(t), motion.sample(t + 3.0)
        for part in ("q", "v", "a"):
            np.testing.assert_allclose(getattr(again, part), getattr(first, part), atol=1e-9)


def test_the_figure_shows_shares_of_the_limits_by_joint(tmp_path: Path) -> None:
    room = Room(Dynamics("two_link"))
    motion = quintic([Waypoint(0.0, [0.3, 0.8]), Waypoint(1.0, [0.9, 0.4])])
    with written() as figures:
        draw_excitation(motion, room, tmp_path / "motion.png")
    (figure,) = figures
    assert "acceleration, of its largest" in [x.get_text() for x in figure.legends[0].texts]
    lines, limits = figure.axes[1].lines, room.limits  # of the elbow
    states = [motion.sample(t) for t in lines[0].get_xdata()]
    q, v, a = (np.array([getattr(state, part) for state in states]) for part in "qva")
    tau = np.array([room.dynamics.inverse(*state) for state in zip(q, v, a, strict=True)])
    middle, half = (limits.lower + limits.upper) / 2, (limits.upper - limits.lower) / 2
    shares = (q - middle) / half, v / limits.velocity, a / abs(a).max(axis=0), tau / room.effort
    for line, share in zip(lines, shares, strict=True):
        np.testing.assert_allclose(line.get_ydata(), 100 * share[:, 1], atol=1e-7)
