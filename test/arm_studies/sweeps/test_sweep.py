# SPDX-License-Identifier: Apache-2.0
"""Sweeps: each run is the closed loop with its values, regardless of worker and order."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from samples import always, sampled

from arm_dynamics import ArmError, InvalidInput
from arm_dynamics.control import Settings
from arm_dynamics.scene import load_scene
from arm_dynamics.trajectory import Waypoint
from arm_sim import ClosedLoop, Recording
from arm_studies.sweeps import Progress, sweep
from arm_studies.sweeps.table import Table

GOAL = {"shoulder": -0.3, "elbow": 0.65}
SCENE: dict[str, Any] = {
    "robot": {"urdf": load_scene("two_link").robot.urdf},
    "payloads": [{"frame": "tip", "mass": 0.5}], "joints": {"*": {"friction": {"viscous": 0.1}}},
    "initial": {"position": {"shoulder": -0.5, "elbow": 0.8}},
}  # fmt: skip
STUDY: dict[str, Any] = {
    "scene": SCENE, "duration": 0.3, "seed": 7,
    "motion": {"points": [{"time": 0.25, "position": GOAL}]},
    "metrics": ["tracking_rms", "tracking_max", "energy", "tracking_max.elbow"],
}  # fmt: skip
LOADED = {"at": [0.0, 10.0], "factor": [1.0, 1.3]}
VARIED = STUDY | {
    "vary": {
        "payloads.0.mass": {"uniform": [0.1, 2.0]},
        "joints.*.friction.viscous": {"log_uniform": [0.05, 1.0]},
    },
    "samples": 12,
}


def loop(
    scene: dict[str, Any], controller: str = "computed_torque", known: Any = SCENE, **settings: Any
) -> Recording:
    """The same closed loop by other means; the controller knows the scene as it was."""
    pair = ClosedLoop(SCENE | scene, controller, Settings(**settings), controller_scene=known)
    pair.follow([Waypoint(0.25, [GOAL[name] for name in pair.simulator.joint_names])])
    return pair.run(0.3)


def energy(run: Recording) -> float:
    """Work of the drives, the metric ``energy``."""
    return float(np.abs(run.tau[:-1] * np.diff(run.q, axis=0)).sum())


@pytest.mark.parametrize(
    "controller",
    always(["computed_torque", "pd", "pd_gravity", "feed_forward", "float"], "computed_torque"),
)
def test_compiled_controllers_are_those_of_the_nodes(controller: str) -> None:
    """Energy of a run, against ``ClosedLoop`` with the controllers in Python."""
    study = STUDY | {
        "controller": controller,
        "vary": {"payloads.0.mass": [0.2, 0.9], "controller.settings.bandwidth": [15.0]},
    }
    done = sweep(study, workers=1)
    assert done.plan.compiled == 2 and done.plan.worlds == 1
    for k, mass in enumerate((0.2, 0.9)):
        other = loop({"payloads": [{"frame": "tip", "mass": mass}]}, controller, bandwidth=15.0)
        np.testing.assert_allclose(done.table["energy"][k], energy(other), rtol=1e-9)


def test_the_time_for_which_a_torque_is_held_is_that_of_the_settings() -> None:
    """A ``dt`` of its own is that of the formula and of the gains, compiled or in Python."""
    study = STUDY | {"vary": {"controller.settings.dt": [1e-4, 0.01]}, "metrics": ["energy"]}
    done = sweep(study, workers=1)
    assert done.plan.compiled == 2 and done.plan.worlds == 1
    for k, dt in enumerate((1e-4, 0.01)):
        np.testing.assert_allclose(done.table["energy"][k], energy(loop({}, dt=dt)), rtol=1e-9)


def test_tunable_numbers_share_one_world_and_mean_what_they_say() -> None:
    study = STUDY | {
        "vary": {"payloads.0.mass": [0.2, 0.9], "joints.*.friction.viscous": [0.1, 0.7],
                 "gravity.2": [-9.81, -1.6]},
        "metrics": ["energy"],
    }  # fmt: skip
    done = sweep(study, workers=1)
    assert done.plan.worlds == 1 and set(done.plan.tunable) == set(study["vary"])
    for k in range(8):
        mass, viscous, weight = (done.table[name][k] for name in study["vary"])
        other = loop({"payloads": [{"frame": "tip", "mass": mass}], "gravity": [0, 0, weight],
                      "joints": {"*": {"friction": {"viscous": viscous}}}})  # fmt: skip
        np.testing.assert_allclose(done.table["energy"][k], energy(other), rtol=1e-9)


@pytest.mark.parametrize("base", [{}, {"coulomb": 0.4, "load": LOADED}])
def test_levels_of_dry_friction_share_one_world(base: dict[str, Any]) -> None:
    study = STUDY | {
        "changes": {"joints": {"*": {"friction": base}}},
        "vary": {"joints.*.friction.coulomb": [0.0, 0.9]}, "metrics": ["energy"],
    }  # fmt: skip
    if "load" in base:  # which is without effect where there is no friction
        study["vary"]["joints.*.friction.coulomb"][0] = 0.1
    done = sweep(study, workers=1)
    assert done.plan.worlds == 1
    levels = done.table["joints.*.friction.coulomb"]
    for level, found in zip(levels, done.table["energy"], strict=True):
        before, after = (
            {"joints": {"*": {"friction": {"viscous": 0.1} | base | own}}}
            for own in ({}, {"coulomb": level})
        )
        expected = energy(loop(after, known=SCENE | before))
        np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert np.ptp(done.table["energy"]) > 0.0


def test_levels_that_change_something_else_have_worlds_of_their_own() -> None:
    friction = {"coulomb": 0.4, "static": 1.5, "stribeck_velocity": 0.1}
    study = STUDY | {
        "changes": {"joints": {"elbow": {"friction": friction}}},
        "vary": {"joints.elbow.friction.coulomb": [0.3, 0.6]}, "metrics": ["energy"],
    }  # fmt: skip
    done = sweep(study, workers=1)
    assert done.plan.worlds == 2 and np.ptp(done.table["energy"]) > 0.0


def test_a_joints_own_friction_goes_before_that_of_all() -> None:
    """Then the key of all joints reaches the others only, as in a scene file."""
    own = {
        "joints": {"*": {"friction": {"viscous": 0.1}}, "elbow": {"friction": {"viscous": 0.3}}}
    }
    study = STUDY | {"changes": own, "metrics": ["energy"],
                     "vary": {"joints.*.friction.viscous": [0.1, 0.7]}}  # fmt: skip
    spelled = STUDY | {"changes": own, "metrics": ["energy"],
                       "vary": {"joints.shoulder.friction.viscous": [0.1, 0.7]}}  # fmt: skip
    ours, theirs = sweep(study, workers=1).table, sweep(spelled, workers=1).table
    np.testing.assert_array_equal(ours["energy"], theirs["energy"])
    assert np.ptp(ours["energy"]) > 0.0


def test_controllers_and_imperfections_are_varied() -> None:
    study = STUDY | {
        "vary": {"controller": ["computed_torque", "pid"], "sensors.position.noise": [0.0, 0.01]},
        "samples": 2,
    }
    table = sweep(study, workers=1).table
    assert table["controller"].tolist() == ["computed_torque"] * 4 + ["pid"] * 4
    quiet, noisy = table["tracking_rms"].reshape(2, 2, 2)[0]
    assert quiet[0] == quiet[1], "without noise there is nothing by chance"
    assert noisy[0] != noisy[1] and np.all(noisy > 2.0 * quiet)


def test_imperfections_without_chance_need_no_seed() -> None:
    """A delay is a model error like any other, beside quantized measurements."""
    changes = {"sensors": {"position": {"counts": 4096}}}
    study = STUDY | {"changes": changes, "vary": {"commands.delay": [0.0, 0.004]}, "samples": 2}
    table = sweep(study, workers=1).table
    prompt, late = table["tracking_rms"].reshape(2, 2)
    assert prompt[0] == prompt[1] and late[0] == late[1]
    assert late[0] > 1.1 * prompt[0]


def test_a_run_that_diverges_or_cannot_be_made_is_a_row() -> None:
    gains = {"controller": {"name": "pd", "settings": {"bandwidth": 5.0}}}
    study = STUDY | gains | {
        "changes": {"sim": {"integrator": "euler"}},
        "vary": {"joints.*.friction.viscous": [0.1, 1e5], "motion.points.0.time": [0.25, -0.2]},
    }  # fmt: skip
    table = sweep(study, workers=1).table
    assert table["status"].tolist() == ["done", "failed", "diverged", "failed"]
    assert np.isfinite(table["energy"][0]) and np.isnan(table["energy"][2])
    assert table["note"][2].startswith("at t = ")
    assert "'motion.points.0.time' = -0.2: more than 0 is expected" in table["note"][1]


OF_THREE = {"bandwidth": [1.0, 2.0, 3.0]}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"vary": {"payloads.0.mass": [-1.0, 0.5]}}, "mass"),
        ({"vary": {"motion.points.0.position.elbow": ["far", 0.25]}}, "far"),
        ({"controller": {"name": "computed_torque", "settings": OF_THREE}}, r"shape \(3,\)"),
        (
            {
                "changes": {"joints": {n: {"friction": {"viscous": 0.3}} for n in GOAL}},
                "vary": {"joints.*.friction.viscous": [0.1, 0.7]},
            },
            "'vary.joints.*.friction.viscous' changes nothing",
        ),
    ],
)
def test_what_the_first_run_cannot_use_is_refused_at_once(
    changes: dict[str, Any], said: str
) -> None:
    with pytest.raises(ArmError, match=said):
        sweep(STUDY | changes, workers=1)


CHANGES: dict[str, dict[str, Any]] = {
    "stops": {
        "controller": {"name": "pd", "settings": {"bandwidth": 3.0}}, "duration": 1.0,
        "changes": {"joints": {"elbow": {"limits": {"lower": 0.5}}}},
    },
    "smooth": {},
    "failing": {"vary": {"payloads.0.mass": {"uniform": [-0.2, 1.0]}}},
    "dry friction": {
        "changes": {"joints": {"elbow": {"friction": {"coulomb": 0.5}}}},
        "vary": {"payloads.0.mass": {"uniform": [0.1, 1.0]}},
    },
    "diverging": {
        "changes": {"sim": {"integrator": "euler"}},
        "vary": {"joints.*.friction.viscous": {"log_uniform": [0.1, 1e5]}},
    },
}  # fmt: skip


@pytest.mark.parametrize("change", sampled(CHANGES.values(), 4), ids=CHANGES)
def test_runs_side_by_side_have_the_bits_of_runs_alone(
    change: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In lanes of vector registers, those that meet a stop, fail or diverge among them."""
    metrics = ["tracking_rms", "energy", "saturation", "stop_time", "torque_rms"]
    study = VARIED | change | {"metrics": metrics}
    monkeypatch.setattr("arm_studies.sweeps.recipes._LEAST_TIME", np.inf)
    alone = bits(sweep(study, workers=1).table)
    monkeypatch.setattr("arm_studies.sweeps.recipes._LEAST_TIME", 0.0)
    assert bits(sweep(study, workers=1).table) == alone


# --- whoever makes them ------------------------------------------------------------------------


def bits(table: Table) -> dict[str, Any]:
    """A table as what can be compared to the bit."""
    return {name: column.tobytes() for name, column in table.columns.items()}


def interrupted(folder: Path) -> None:
    def interrupt(progress: Progress) -> None:
        if progress.done >= 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(VARIED, folder, workers=1, on_progress=interrupt)


def test_a_sweep_that_was_ended_goes_on(tmp_path: Path) -> None:
    interrupted(tmp_path)
    first = sweep(VARIED, tmp_path, workers=1)
    assert 0 < first.simulated < 12
    assert bits(first.table) == bits(sweep(VARIED, workers=1).table)
    assert sweep(VARIED, tmp_path, workers=1).simulated == 0
    alone = sweep(VARIED | {"samples": 1}, workers=1).table
    assert alone["energy"][0] == first.table["energy"][0]


def test_a_journal_is_read_as_far_as_it_is_whole(tmp_path: Path) -> None:
    whole, journal = sweep(VARIED, tmp_path, workers=1).table, tmp_path / "runs.jsonl"
    raw, lines = journal.read_bytes(), journal.read_text().splitlines()
    for cut, simulated in ((raw[:-1], 1), (raw[:-40], 1), (raw[:20], 12)):
        journal.write_bytes(cut)
        again = sweep(VARIED, tmp_path, workers=1)
        assert again.simulated == simulated and again.dropped
        assert bits(again.table) == bits(whole)
    for text, said in (
        ("something else\n", "is not the journal of a sweep"),
        ("\n".join([*lines[:3], "rubbish", *lines[3:], ""]), "line 4: not a run"),
    ):
        journal.write_text(text)
        with pytest.raises(InvalidInput, match=said):
            sweep(VARIED, tmp_path, workers=1)
        assert journal.read_text() == text


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"seed": 8}, "'study.seed' was 7 and is 8"),
        ({"changes": {"gravity": [0, 0, 0]}}, "'study.changes' was not given"),
        ({"vary": dict(reversed(VARIED["vary"].items()))}, "'order of vary' was "),
    ],
)
def test_a_study_that_changed_is_refused_by_name(
    change: dict[str, Any], said: str, tmp_path: Path
) -> None:
    interrupted(tmp_path)
    with pytest.raises(InvalidInput, match=said):
        sweep(VARIED | change, tmp_path, workers=1)


@pytest.mark.parametrize(
    ("file", "key"),
    [("second", "scene"), ("known", "controller.scene"), ("to", "motion.file")],
)
def test_a_file_that_changed_is_noticed(file: str, key: str, tmp_path: Path) -> None:
    """Also of two scenes whose paths begin alike."""
    folder, urdf = tmp_path / (80 * "f"), load_scene("two_link").robot.urdf

    def write(name: str, x: float) -> None:
        points = [{"positions": [k * x, 0.0], "time_from_start": {"sec": k}} for k in (0, 1)]
        course = {"joint_names": ["shoulder", "elbow"], "points": points}
        scene = {"robot": {"urdf": urdf}, "gravity": [0, 0, -x]}
        (folder / f"{name}.yaml").write_text(json.dumps(course if name == "to" else scene))

    folder.mkdir()
    for name in ("first", "second", "known", "to"):
        write(name, 1.6)
    (folder / "study.yaml").write_text(
        "scene: first.yaml\nvary: {scene: [first.yaml, second.yaml]}\nduration: 0.01\n"
        "controller: {scene: known.yaml}\nmotion: {file: to.yaml}\n"
    )
    sweep(folder / "study.yaml", tmp_path, workers=1)
    assert sweep(folder / "study.yaml", tmp_path, workers=1).simulated == 0
    write(file, 1.7)
    with pytest.raises(InvalidInput, match=f"'content of {key}.* was "):
        sweep(folder / "study.yaml", tmp_path, workers=1)


def test_two_sweeps_do_not_write_one_journal(tmp_path: Path) -> None:
    def told(progress: Progress) -> None:
        if progress.done:
            with pytest.raises(InvalidInput, match="is being written by another sweep"):
                sweep(VARIED, tmp_path, workers=1)

    with pytest.warns(DeprecationWarning, match="now (on_progress=|simulated)"):  # as of old
        assert sweep(VARIED, tmp_path, workers=1, told=told).made == 12


# --- in other processes ------------------------------------------------------------------------

with_group = pytest.mark.group("sweep")
SHARED = VARIED | {
    "vary": {"controller": ["computed_torque", "pid"], **VARIED["vary"]}, "samples": 8,
}  # fmt: skip
RUNS = 16  # of two controllers


@pytest.fixture(scope="module")
def alone() -> dict[str, Any]:
    """The table of this process alone."""
    return bits(sweep(SHARED, workers=1).table)


@with_group
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # the cluster's own sockets
def test_a_cluster_makes_the_same_table(alone: dict[str, Any], tmp_path: Path) -> None:
    import distributed

    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=str(tmp_path)
    ) as cluster:
        pids = {worker.pid for worker in cluster.workers.values()}
        assert len(pids - {os.getpid()}) == 2
        assert bits(sweep(SHARED, cluster=cluster.scheduler_address).table) == alone


@with_group
def test_killed_with_its_workers_and_called_again(alone: dict[str, Any], tmp_path: Path) -> None:
    """The kill is real: SIGKILL, once the first runs are in the journal; workers end by it."""
    file, out = tmp_path / "study.yaml", tmp_path / "out"
    file.write_text(yaml.safe_dump(SHARED, sort_keys=False))
    killer = (
        "import os, signal, sys\n"
        "from pathlib import Path\n"
        "from arm_studies.sweeps import sweep\n"
        "def told(progress):\n"
        "    if progress.done:\n"
        "        tasks = Path('/proc/self/task').glob('*/children')\n"
        "        print(*(task.read_text() for task in tasks), flush=True)\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "sweep(sys.argv[1], sys.argv[2], workers=2, on_progress=told)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-P", "-c", killer, str(file), str(out)],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    ) as killed:  # fmt: skip
        # The pipe is closed when the last of its writers has ended, workers included.
        told, _ = killed.communicate(timeout=120)
    children = [int(pid) for pid in told.split()]
    assert killed.returncode == -signal.SIGKILL and len(children) >= 2
    until = time.monotonic() + 20.0
    while any(map(running, children)) and time.monotonic() < until:
        time.sleep(0.1)
    assert [pid for pid in children if running(pid)] == []
    done = len((out / "runs.jsonl").read_text().splitlines()) - 1
    assert 0 < done < RUNS
    again = sweep(file, out, workers=1)
    assert again.simulated == RUNS - done
    assert bits(again.table) == alone


def running(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@with_group
@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"workers": 0}, "workers = "),
        ({"workers": 2, "cluster": "tcp://127.0.0.1:1"}, "a cluster has its own workers"),
        ({"cluster": "tcp://127.0.0.1:1"}, "'tcp://127.0.0.1:1': no Dask scheduler answers"),
    ],
)
def test_nobody_to_share_with(
    given: dict[str, Any], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arm_studies.sweeps.sharing._TIMEOUT", 0.2)
    with pytest.raises(InvalidInput, match=said):
        sweep(SHARED, **given)


def test_missing_libraries_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "joblib", None)
    with pytest.raises(InvalidInput, match="cannot find the module 'joblib'.*arm setup sweep"):
        sweep(SHARED, workers=2)
