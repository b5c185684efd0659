# SPDX-License-Identifier: Apache-2.0
"""Scenes compared with recordings of simulations of known parameters."""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner, Result

from arm_dynamics import InvalidInput, load_scene
from arm_dynamics.control import ComputedTorque
from arm_dynamics.trajectory import Waypoint, quintic
from arm_sim import Recording, Simulator
from arm_studies.cli.main import main
from arm_studies.identification import JointRecord, compare

NOMINAL = load_scene("two_link").model_dump(exclude_unset=True)
HEAVY = NOMINAL | {"payloads": [{"frame": "tip", "mass": 0.5}]}


@cache
def run() -> Recording:
    """Six seconds of the heavy arm on a quintic course."""
    sim = Simulator(HEAVY)
    goals = [(0.9, -0.8), (-1.2, 1.4), (0.3, 0.2), (-0.5, 0.8)]
    points = [Waypoint(1.5 * k, q) for k, q in enumerate([tuple(sim.state.q), *goals])]
    return sim.run(6.0, ComputedTorque(sim.dynamics), quintic(points))


def record() -> JointRecord:
    return JointRecord.from_recording(run())


def test_the_true_scene_has_no_error() -> None:
    found = compare(HEAVY, record())
    assert np.all(found.relative < 2e-3) and found.whole < 1e-3
    assert found.free_run is not None
    assert found.free_run.count >= 20 and not found.free_run.diverged
    assert np.all(found.free_run.relative < 2e-3)


def test_a_free_run_does_not_delay_torques_that_have_acted() -> None:
    found = compare(HEAVY | {"commands": {"delay": 0.02}}, record())
    assert found.free_run is not None and np.all(found.free_run.relative < 2e-3)


def test_windows_in_which_an_effort_of_one_joint_is_missing_are_left_out() -> None:
    effort = record().effort.copy()
    effort[2000:3500, 1] = np.nan
    found = compare(HEAVY, changed(effort=effort))
    assert found.free_run is not None
    assert found.free_run.count <= 17 and not found.free_run.diverged
    assert np.all(found.free_run.relative < 2e-3)


def test_positions_that_jump_by_whole_turns_are_unwrapped() -> None:
    good = record()
    found = compare(HEAVY, changed(q=good.q + 2.0 * np.pi * (good.time > 3.0)[:, None]))
    assert found.whole < 1e-3 and any("are unwrapped" in note for note in found.notes)


def test_the_error_of_another_scene_is_what_it_lacks() -> None:
    """A payload of m at the tip: its torque by the definition of inverse dynamics."""
    found = compare(NOMINAL, record())
    rows = np.isfinite(found.measured).all(axis=1)
    heavy, bare = Simulator(HEAVY).dynamics, Simulator(NOMINAL).dynamics
    q, v = run().q, run().v
    a = np.gradient(v, run().time, axis=0)
    lacking = np.array([
        heavy.inverse(*x) - bare.inverse(*x) for x in zip(q, v, a, strict=True)
    ])[rows]  # fmt: skip
    np.testing.assert_allclose(found.error, np.sqrt(np.mean(lacking**2, axis=0)), rtol=5e-3)
    size = np.sqrt(np.mean(found.measured[rows] ** 2, axis=0))
    np.testing.assert_allclose(found.relative, found.error / size, rtol=1e-6)
    assert found.whole > 0.1
    assert found.free_run is not None and np.all(found.free_run.relative > 0.02)


def test_drives_have_no_free_run_and_say_so() -> None:
    drive = {"elbow": {"actuator": {"gear_ratio": 50.0, "rotor_inertia": 1e-6}}}
    found = compare(HEAVY | {"joints": drive}, record())
    assert found.free_run is None and "scene has drives" in found.why_not


def changed(**parts: Any) -> JointRecord:
    good = record()
    whole = {"q": good.q, "effort": good.effort} | parts
    return JointRecord.of(good.joint_names, good.time, whole["q"], whole["effort"])


REFUSED: dict[str, Callable[[], object]] = {
    "all efforts are zero": lambda: compare(NOMINAL, changed(effort=np.zeros((6001, 2)))),
    "no joint moves": lambda: compare(NOMINAL, changed(q=np.zeros((6001, 2)))),
    "the scene has closed loops": lambda: compare("four_bar", record()),
    "window": lambda: compare(NOMINAL, record(), window=0.0),
    "last = 1.5": lambda: compare(NOMINAL, record(), last=1.5),
}  # fmt: skip


@pytest.mark.parametrize("said", REFUSED)
def test_what_cannot_be_compared_is_refused(said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        REFUSED[said]()


def test_before_and_after_stand_side_by_side(tmp_path: Path) -> None:
    """As typed, of the last part; the recording calls the joints otherwise."""
    path, better = tmp_path / "run.csv", tmp_path / "better.yaml"
    good, figure = record(), tmp_path / "both.png"
    np.savetxt(
        path, np.column_stack([good.time, good.q, good.effort]), delimiter=",", comments="",
        header="time,position.one,position.two,effort.one,effort.two",
    )  # fmt: skip
    better.write_text(yaml.safe_dump(json.loads(json.dumps(HEAVY))))

    def typed(*words: str) -> Result:
        names = "--map", "shoulder=one", "--map", "elbow=two"
        words = "compare", "two_link", str(path), str(better), *names, *words
        return CliRunner().invoke(main, words, env={"COLUMNS": "200"})

    told = JointRecord.from_recording(Recording.load(path))
    names = {"shoulder": "one", "elbow": "two"}
    made = [compare(scene, told, names=names, last=0.5) for scene in (NOMINAL, HEAVY)]
    assert len(made[0].time) == pytest.approx(3000, abs=2) and made[1].whole < 1e-3
    done = typed("--last", "0.5", "--figure", str(figure))
    assert done.exit_code == 0, done.output
    assert figure.stat().st_size > 20_000
    assert all(f"{x:.3g}" in done.output for x in made[0].free_run.moved)
    scenes = json.loads(typed("--last", "0.5", "--json").stdout)["scenes"]
    for said, each in zip(scenes, made, strict=True):
        assert list(said["torque_error"].values()) == pytest.approx(each.error, rel=1e-6)
        assert list(said["free_run"]["error"].values()) == pytest.approx(each.free_run.error, 1e-6)
