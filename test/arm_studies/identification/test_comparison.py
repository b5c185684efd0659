# SPDX-License-Identifier: Apache-2.0
"""Scenes compared with recordings of simulations of known parameters."""

import json
import re
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
    assert found.free_run.count >= 20 and not found.free_run.lost
    assert np.all(found.free_run.relative < 2e-3)
    assert f"{found!r}".startswith("<Comparison: torque error 0.0")
    assert f"<FreeRun: {found.free_run.count} windows of 0.25 s; errors" in f"{found!r}"


def test_a_free_run_does_not_delay_torques_that_have_acted() -> None:
    found = compare(HEAVY | {"commands": {"delay": 0.02}}, record())
    assert found.free_run is not None and np.all(found.free_run.relative < 2e-3)


def test_windows_in_which_an_effort_of_one_joint_is_missing_are_left_out() -> None:
    good = record()
    effort = good.effort.copy()
    effort[2000:3500, 1] = np.nan
    found = compare(HEAVY, JointRecord.of(good.joint_names, good.time, good.q, effort))
    assert found.free_run is not None
    assert found.free_run.count <= 17 and not found.free_run.lost
    assert np.all(found.free_run.relative < 2e-3)


def test_positions_that_jump_by_whole_turns_are_unwrapped() -> None:
    good = record()
    q = good.q + 2.0 * np.pi * (good.time > 3.0)[:, None]
    found = compare(HEAVY, JointRecord.of(good.joint_names, good.time, q, good.effort))
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
    assert found.whole > 0.1
    assert found.free_run is not None and np.all(found.free_run.relative > 0.02)


def test_the_last_part_alone_can_be_looked_at() -> None:
    assert len(compare(HEAVY, record(), last=0.3).time) == pytest.approx(1800, abs=2)


def test_drives_have_no_free_run_and_say_so() -> None:
    drive = {"elbow": {"actuator": {"gear_ratio": 50.0, "rotor_inertia": 1e-6}}}
    found = compare(HEAVY | {"joints": drive}, record())
    assert found.free_run is None and "scene has drives" in found.why_not


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"effort": np.full((6001, 2), np.nan)}, "efforts of shoulder, elbow are missing"),
        ({"effort": np.zeros((6001, 2))}, "all efforts are zero"),
        ({"q": np.zeros((6001, 2))}, "no joint moves"),
        ({"joint_names": ("a", "b")}, "shoulder"),
    ],
)
def test_useless_recordings_are_refused(changes: dict[str, Any], said: str) -> None:
    good = record()
    parts = {"joint_names": good.joint_names, "q": good.q, "effort": good.effort} | changes
    bad = JointRecord.of(parts["joint_names"], good.time, parts["q"], parts["effort"])
    with pytest.raises(InvalidInput, match=said):
        compare(NOMINAL, bad)


def test_loops_and_odd_arguments_are_refused() -> None:
    with pytest.raises(InvalidInput, match="the scene has closed loops"):
        compare("four_bar", record())
    with pytest.raises(InvalidInput, match="window"):
        compare(NOMINAL, record(), window=0.0)
    with pytest.raises(InvalidInput, match="last = 1.5"):
        compare(NOMINAL, record(), last=1.5)


# --- as it is typed ----------------------------------------------------------------------------


def typed(*words: str) -> Result:
    return CliRunner().invoke(main, ["compare", *words], env={"COLUMNS": "200"})


def test_before_and_after_stand_side_by_side(tmp_path: Path) -> None:
    path, better = run().save(tmp_path / "run.mcap"), tmp_path / "better.yaml"
    better.write_text(yaml.safe_dump(json.loads(json.dumps(HEAVY))))
    figure = tmp_path / "both.png"
    done = typed("two_link", str(path), str(better), "--figure", str(figure))
    assert done.exit_code == 0, done.output
    assert "before error" in re.sub(r"\s+", " ", done.output), done.output
    assert "windows of 0.25 s" in done.output
    made = [compare(scene, record()) for scene in (NOMINAL, HEAVY)]
    rows = {line.split()[0]: line for line in done.output.splitlines() if line.split()}
    for i, joint in enumerate(made[0].joint_names):
        runs = [each.free_run for each in made]
        words = [f"{made[0].torque[i]:.4g}", *(f"{each.error[i]:.3g}" for each in made)]
        words += [f"{100.0 * each.relative[i]:.2f} %" for each in made]
        words += [f"{runs[0].moved[i]:.3g}", *(f"{run.error[i]:.2g}" for run in runs)]
        assert rows[joint].split()[1:] == " ".join(words).split()
    whole = [f"{np.linalg.norm(made[0].torque):.4g}"]
    whole += [f"{np.linalg.norm(each.error):.3g}" for each in made]
    whole += [f"{100.0 * each.whole:.2f} %" for each in made]
    assert rows["all"].split()[1:] == " ".join(whole).split()
    assert figure.stat().st_size > 20_000
    done = typed("two_link", str(path), str(better), "--json")
    before, after = json.loads(done.stdout)["scenes"]
    assert before["relative_of_all"] > 50.0 * after["relative_of_all"]
    for told, each in zip((before, after), made, strict=True):
        assert told["band"] == pytest.approx(each.band) and told["notes"] == list(each.notes)
        assert list(told["torque_error"].values()) == pytest.approx(each.error, rel=1e-6)
        assert list(told["relative"].values()) == pytest.approx(each.relative, rel=1e-6)
        free, ran = told["free_run"], each.free_run
        assert (free["window"], free["windows"], free["diverged"]) == (0.25, ran.count, 0)
        assert list(free["error"].values()) == pytest.approx(ran.error, rel=1e-6)
        assert list(free["relative"].values()) == pytest.approx(ran.relative, rel=1e-6)
    assert set(after["free_run"]["error"]) == {"shoulder", "elbow"}


def test_joints_may_have_other_names(tmp_path: Path) -> None:
    good = record()
    odd = JointRecord.of(("one", "two"), good.time, good.q, good.effort)
    found = compare(HEAVY, odd, names={"shoulder": "one", "elbow": "two"})
    assert found.whole < 1e-3
    done = typed("two_link", str(run().save(tmp_path / "a.mcap")), "--map", "shoulder")
    assert done.exit_code == 2 and "JOINT=NAME is expected" in done.output
