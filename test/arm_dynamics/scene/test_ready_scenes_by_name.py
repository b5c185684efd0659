# SPDX-License-Identifier: Apache-2.0
"""Scenes are found by bare name, from any folder and however the packages are installed."""

import re
from pathlib import Path

import pytest

from arm_dynamics import SceneError, load_scene
from arm_dynamics.scene import ready_scenes

ROOT = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder without scenes to be in."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("ARM_SCENES", raising=False)
    return tmp_path


def own(folder: Path, name: str, mass: float) -> Path:
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(
        "robot: {urdf: package://arm_sim/scenes/two_link.urdf}\n"
        f"payloads: [{{frame: tip, mass: {mass}}}]\n"
    )
    return path


def test_a_file_of_the_name_comes_first_and_folders_of_ones_own_second(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (elsewhere / "two_link").mkdir()  # a folder is no scene
    assert not load_scene("two_link").payloads
    own(elsewhere / "mine", "two_link.yaml", 2.0)
    own(elsewhere / "mine", "heavy.yaml", 3.0)
    monkeypatch.setenv("ARM_SCENES", f"{elsewhere / 'nowhere'}:{elsewhere / 'mine'}")
    assert load_scene("two_link").payloads[0].mass == 2.0
    assert load_scene("heavy").payloads[0].mass == 3.0 and "heavy" in ready_scenes()
    own(elsewhere, "two_link.yaml", 1.0)
    assert load_scene("two_link.yaml").payloads[0].mass == 1.0


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("pandda", "no file 'pandda' .* did you mean 'panda'\\?$"),
        ("qqqqqqq", "no bundled scene of that name\\. Bundled scenes: .*bricard, .* z1"),
        ("package://", "is a folder; a file is expected"),
        ("x" * 5000, r"no file 'xxx.* … .*xxx' in"),
        ("~nobody-of-this-name/arm.yaml", "no file '~nobody-of-this-name/arm.yaml'; searched: "),
        ("two\nlink", "neither URDF text nor the name of a file"),
        ("/dev/null", "'/dev/null' is a pipe or a device; a file is expected"),
    ],
)
def test_what_is_not_there_is_refused_by_name(name: str, said: str) -> None:
    with pytest.raises(SceneError) as error:
        load_scene(name)
    assert re.search(said, str(error.value))


def test_the_package_with_the_robots_is_named_where_it_is_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sys.path", [str(ROOT / "src/arm_sim")])
    with pytest.raises(SceneError, match="pip install example-robot-data$"):
        load_scene("panda")
