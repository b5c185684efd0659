# SPDX-License-Identifier: Apache-2.0
"""``./arm identify``: a scene that loads, a report that says what was found, and refusals."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from arm_dynamics import Dynamics, load_scene
from arm_sim import Simulator
from arm_studies.cli.main import main

TRUE = {
    "robot": {"urdf": "package://arm_sim/scenes/two_link.urdf"},
    "joints": {
        "shoulder": {"friction": {"viscous": 0.5, "coulomb": 1.0}, "armature": 0.2},
        "elbow": {"friction": {"viscous": 0.3, "coulomb": 0.6}, "armature": 0.1},
    },
}


@pytest.fixture(scope="module")
def table(tmp_path_factory) -> Path:
    """Positions and torques of a robot under other names, without velocities."""
    t, w, phase = np.arange(0.0, 10.0, 0.01)[:, None], np.array([2.1, 3.3]), np.array([0.0, 1.0])
    q = 0.9 * np.sin(w * t + phase) + 0.3 * np.cos(5.0 * t)
    v = 0.9 * w * np.cos(w * t + phase) - 1.5 * np.sin(5.0 * t)
    a = -0.9 * w**2 * np.sin(w * t + phase) - 7.5 * np.cos(5.0 * t)
    tau = Dynamics(TRUE).inverse(q, v, a)
    path = tmp_path_factory.mktemp("robot") / "robot.csv"
    names = ["left_shoulder", "left_elbow"]
    head = ["time", *(f"position.{n}" for n in names), *(f"effort.{n}" for n in names)]
    np.savetxt(
        path, np.column_stack([t, q, tau]), delimiter=",", header=",".join(head), comments=""
    )
    return path


def changed(table: Path, record: np.ndarray, name: str) -> Path:
    """The table with other numbers."""
    path, head = table.with_name(name), table.read_text().splitlines()[0]
    np.savetxt(path, record, delimiter=",", header=head, comments="")
    return path


def true_scene(folder: Path) -> Path:
    known = load_scene(TRUE).model_dump(exclude_unset=True, mode="json")
    (folder / "true.urdf").write_text(known["robot"]["urdf"])
    (folder / "true.yaml").write_text(json.dumps(known | {"robot": {"urdf": "true.urdf"}}))
    return folder / "true.yaml"


def typed(*arguments: object):
    return CliRunner().invoke(main, ["identify", *map(str, arguments)])


def test_a_scene_that_simulates_and_a_report(table, tmp_path):
    out = tmp_path / "found" / "mine.yaml"
    done = typed(table, "--scene", "two_link", "--out", out)
    assert done.exit_code == 0, done.output
    told = " ".join(done.output.split())
    assert "9 parameters identified, 4 not" in told  # two are found, but may be zero
    scene = load_scene(out)
    assert scene.joints["elbow"].friction.coulomb == pytest.approx(0.6, rel=1e-2)
    sim = Simulator(scene, dt=1e-3)
    sim.run(0.05, [1.0, 0.5])
    report = (tmp_path / "found" / "mine.md").read_text()
    assert "elbow: Coulomb" in report and "Not identified" in report
    assert "left_shoulder" in report  # which was taken for the scene's
    for figure in ("torques", "friction"):
        assert (tmp_path / "found" / f"mine_{figure}.png").stat().st_size > 20_000


def test_a_payload_alone(table, tmp_path):
    """What the arm held beside what its scene says."""
    held = {
        "frame": "tip",
        "mass": 0.5,
        "com": [0.1, 0, 0],
        "inertia": [1e-3, 0, 0, 1e-3, 0, 1e-3],
    }
    record = np.loadtxt(table, delimiter=",", skiprows=1)
    q, t = record[:, 1:3], record[:, 0]
    v = np.gradient(q, t, axis=0)
    a = np.gradient(v, t, axis=0)
    loaded = Dynamics(TRUE | {"payloads": [held]}).inverse(q, v, a)
    record[:, 3:] += loaded - Dynamics(TRUE).inverse(q, v, a)
    record[500:600, 4] = np.nan
    heavier, out = changed(table, record, "held.csv"), tmp_path / "holding.yaml"
    done = typed(heavier, "--scene", true_scene(tmp_path), "--payload", "tip", "--out", out)
    assert done.exit_code == 0, done.output
    assert re.search(r"\bmass +0\.\d+ +kg +0\.\d+ to 0\.\d+ ", done.output)
    undetermined = r"inertia\.x[xyz] .*the motion does not determine it"
    assert len(re.findall(undetermined, done.output)) == 3
    assert len(re.findall(f"(?m)^# {undetermined}$", out.read_text())) == 3
    assert "note: 'elbow': no effort in 100 rows (5.000 to 5.990 s" in done.output
    (found,) = load_scene(out).payloads
    assert found.mass == pytest.approx(0.5, rel=0.02)
    assert found.com[0] == pytest.approx(0.1, rel=0.05)


def test_refusals_leave_nothing_behind(table, tmp_path):
    out = tmp_path / "a.yaml"
    given = table, "--scene", "two_link", "--out", out
    for arguments, said in (
        ((table, "--scene", "panda", "--out", out), "no joint matches panda_joint1"),
        ((table, "--scene", "two_link", "--out", tmp_path / "a.txt"), "allowed: .yaml"),
        ((*given, "--mass", "elbow"), "JOINT=KG"),
        ((*given, "--map", "hip=y"), "no joint 'hip'"),
        ((*given, "--payload", "tip", "--total-mass", "3"), "not allowed with it"),
        ((*given, "--effort", "scale", "--per-unit", "elbow=1"), "one of them is expected"),
        ((table, "--out", out), "Missing option '--scene'"),
    ):
        done = typed(*arguments)
        assert done.exit_code and said in done.output + str(done.exception), done.output
        assert not out.exists()


def test_a_scene_that_predicts_worse_than_the_nominal_one_only_if_asked(table, tmp_path):
    """The nominal scene is the true one, but the first part of the recording has more friction."""
    true = true_scene(tmp_path)
    record = np.loadtxt(table, delimiter=",", skiprows=1)
    speeds = np.gradient(record[:, 1:3], record[:, 0], axis=0)
    record[:700, 3:] += np.sign(speeds[:700])
    sticky, out = changed(table, record, "sticky.csv"), tmp_path / "a.yaml"
    done = typed(sticky, "--scene", true, "--out", out)
    said = " ".join(done.output.split())
    assert done.exit_code == 1
    assert re.search(r"more than the nominal scene, 0\.\d.*accept worse", said), said
    assert not out.exists()
    done = typed(sticky, "--scene", true, "--out", out, "--accept-worse", "--json")
    assert done.exit_code == 0 and out.exists()
    told = json.loads(done.stdout)
    assert told["error"] > told["nominal_error"]
