# SPDX-License-Identifier: Apache-2.0
"""Studies: how files are read, errors for mistakes, and points: grids and samples, which depend on
seed and number alone.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.stats

from arm_dynamics import ArmError
from arm_studies.sweeps import load_study, sweep
from arm_studies.sweeps.design import noise_seed, points

PLAIN: dict[str, Any] = {"scene": "two_link", "duration": 0.1}


def test_paths_are_relative_to_the_study(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("robot: {urdf: any.urdf}\n")
    (tmp_path / "study.yaml").write_text(
        "scene: mine.yaml\nduration: 1\nmotion: {file: course.yaml}\n"
    )
    study = load_study(tmp_path / "study.yaml")
    assert study.scene == str(tmp_path / "mine.yaml")
    assert study.motion.file == str(tmp_path / "course.yaml")


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ({"durations": 1}, "study: unknown key 'durations' = 1; allowed here: .*did you mean"),
        ({"sampling": "sobol"}, "'sampling' = 'sobol': allowed: random, latin_hypercube"),
        ({"metrics": ["tracking_rsm"]}, "unknown metric .*did you mean 'tracking_rms'"),
        ({"vary": {"sim.dt": []}}, "'vary.sim.dt' = .*the list is empty"),
        ({"vary": {"sim.dt": {"uniform": [2, 1]}}}, "the lower end must lie below"),
        ({"motion": {"points": [{"time": 1}]}}, "'motion.points.0.position' is missing"),
        ({"vary": {"joints.*.friction.viscos": [1]}}, "'joints.*.friction.viscos'.*did you mean"),
        ({"vary": {"payloads.0.mass": [1]}}, "'vary.payloads.0.mass': there is no 'payloads.0'"),
        ({"changes": {"payload": []}}, "study: 'changes': .*did you mean 'payloads'"),
        ({"vary": {"controller.settings.bandwith": [1]}}, "did you mean 'bandwidth'"),
        ({"controller": {"scene": "panda"}}, "the controller's scene has joints"),
    ],
)
def test_mistakes_are_named(part: dict[str, Any], said: str) -> None:
    with pytest.raises(ArmError, match=said):
        sweep(PLAIN | part, workers=1)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("scene: two_link\nduration: -1\n", r"study\.yaml:2: study: 'duration' = -1"),
        ("scene: [\n", "study: "),
    ],
)
def test_mistakes_in_files_are_named(content: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "study.yaml"
    file.write_text(content)
    with pytest.raises(ArmError, match=said):
        load_study(file)


# --- points ------------------------------------------------------------------------------------

DRAWN = {"gravity.0": {"uniform": [-1, 3]}, "gravity.1": {"log_uniform": [0.1, 10]},
         "gravity.2": {"normal": [5, 2]}}  # fmt: skip


def columns(**more: Any) -> np.ndarray:
    study = load_study({"scene": "two_link", "duration": 1, "vary": DRAWN, **more})
    return np.array([list(point.values.values()) for point in points(study)])


def test_lists_make_a_grid_that_meets_the_same_samples() -> None:
    vary = {"a": [1, 2], **DRAWN, "b": ["x", "y", "z"]}
    study = load_study(
        {"scene": "two_link", "duration": 1, "vary": {f"sim.{k}": v for k, v in vary.items()},
         "samples": 5}
    )  # fmt: skip
    made = points(study)
    assert [point.index for point in made] == list(range(30))
    grid = {(point.values["sim.a"], point.values["sim.b"]) for point in made}
    assert grid == {(a, b) for a in (1, 2) for b in "xyz"}
    drawn = {point.values["sim.gravity.0"] for point in made}
    assert len(drawn) == 5


def test_distributions_are_what_they_are_called() -> None:
    low, middle, high = columns(samples=2000, seed=4).T
    assert scipy.stats.kstest(low, scipy.stats.uniform(-1, 4).cdf).pvalue > 0.01
    assert scipy.stats.kstest(middle, scipy.stats.loguniform(0.1, 10).cdf).pvalue > 0.01
    assert scipy.stats.kstest(high, scipy.stats.norm(5, 2).cdf).pvalue > 0.01


def test_a_latin_hypercube_has_one_point_in_each_slice() -> None:
    count = 50
    low, middle, high = columns(samples=count, sampling="latin_hypercube").T
    shares = [(low + 1) / 4, np.log(middle / 0.1) / np.log(100), scipy.stats.norm(5, 2).cdf(high)]
    for share in shares:
        assert sorted(np.floor(count * share).astype(int)) == list(range(count))
    assert abs(np.corrcoef(shares)[np.triu_indices(3, 1)]).max() < 0.5


def test_random_samples_depend_on_seed_and_number_alone() -> None:
    few, many = columns(samples=3), columns(samples=10)
    np.testing.assert_array_equal(few, many[:3])
    assert not np.any(columns(samples=3, seed=1) == few)
    study = load_study({"scene": "two_link", "duration": 1})
    seeds = [noise_seed(study, k) for k in range(100)]
    assert len(set(seeds)) == 100 and seeds == [noise_seed(study, k) for k in range(100)]
