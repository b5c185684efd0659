# SPDX-License-Identifier: Apache-2.0
"""Export: names, folders, errors, CMake, the command."""

import ctypes
import re
import shutil
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import pytest
from click.testing import CliRunner
from exported import BITS, C11, CPP17, STRICT, Library, said_by

import models
from arm_dynamics import ArmError, InvalidInput
from arm_sim.cli.main import main
from arm_sim.export import export
from arm_sim.export.conditions import without_decided_conditions
from arm_sim.export.names import from_title

SCENE = "two_link"
TWO_LINK = models.scene(SCENE).model_dump(exclude_none=True)


def exported(folder: Path, **options: object) -> Path:
    export(SCENE, folder, "arm", terms=("gravity",), tick=False, **options)
    return folder


def test_names_that_no_library_can_have_are_refused(tmp_path: Path) -> None:
    for name in ("", "7up", "my-arm", "größe", "class", "test", "_arm", 64 * "a"):
        with pytest.raises(InvalidInput, match="name = "):
            export(SCENE, tmp_path / "out", name)
    assert list(tmp_path.iterdir()) == []


def test_a_title_becomes_a_name(tmp_path: Path) -> None:
    """That of the scene, if none is given."""
    for title, name in (("UR-10 (v2)", "ur_10_v2"), ("3R", "arm_3r"), ("double", "double_arm"),
                        ("***", "arm")):  # fmt: skip
        assert from_title(title) == name
    assert export(SCENE, tmp_path, terms=(), tick=False).name == "two_link"
    assert (tmp_path / "two_link.h").is_file()


@pytest.mark.parametrize(("arguments", "said"), [
    ({"scene": {"robot": {"urdf": "nowhere.urdf"}}}, "no file 'nowhere.urdf'"),
    (
        {"scene": TWO_LINK | {"sensors": {"delay": 0.001}}, "tick": True},
        "sensors: an exported",
    ),
    ({"scene": TWO_LINK | {"commands": {"delay": 0.001}}, "tick": True}, "tick has no delay"),
    ({"terms": ("gravity", "inertia")}, "terms names 'inertia'; allowed: inverse_dynamics"),
    ({"frames": ("nowhere",)}, "nowhere"),
    ({"frames": ("base",), "tick": True, "fmu": True}, "'base' does not move"),
    ({"frames": ("forearm", "forearm")}, "would both be 'forearm'"),
])  # fmt: skip
def test_wrong_arguments_write_nothing(
    arguments: dict[str, Any], said: str, tmp_path: Path
) -> None:
    with pytest.raises(ArmError, match=said):
        export(**{"scene": SCENE, "out": tmp_path / "out", "tick": False, **arguments})
    assert list(tmp_path.iterdir()) == []


def test_foreign_folders_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "note.txt").write_text("mine")
    with pytest.raises(InvalidInput, match=r"contains other files \(note.txt\)"):
        exported(tmp_path)
    with pytest.raises(InvalidInput, match="is not a folder"):
        exported(tmp_path / "note.txt")
    assert [path.name for path in tmp_path.iterdir()] == ["note.txt"]


def test_a_folder_that_cannot_be_replaced_stays_as_it_is(tmp_path: Path) -> None:
    folder = exported(tmp_path / "out")
    (folder / "arm.h").unlink()
    (folder / "arm.h").mkdir()
    before = (folder / "arm.c").read_bytes()
    (folder / "other.c").write_text("mine")
    for name, said in (("arm", "arm.h' is a folder"), ("other", "other.c' was not exported")):
        with pytest.raises(InvalidInput, match=said):
            export(SCENE, folder, name, terms=(), tick=False)
    assert (folder / "arm.c").read_bytes() == before
    assert (folder / "other.c").read_text() == "mine" and not (folder / "other.h").exists()
    for damaged in ("[", '["arm.c", 1]'):
        (folder / "export.json").write_text(damaged)
        with pytest.raises(InvalidInput, match="export.json' is damaged"):
            exported(folder)


def test_an_export_that_failed_midway_may_be_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, move = exported(tmp_path / "new/out"), Path.replace

    def failing(old: Path, new: Path) -> Path:
        if new.name == "test_other.c":
            raise OSError
        return move(old, new)

    with monkeypatch.context() as patch, pytest.raises(OSError):
        patch.setattr(Path, "replace", failing)
        export(SCENE, folder, "other", terms=(), tick=False)
    (folder / "build").mkdir()
    export(SCENE, folder, "third", terms=(), tick=False)
    assert {path.name for path in folder.iterdir()} == {
        "third.c", "third.h", "test_third.c", "CMakeLists.txt", "README.md", "scene.yaml",
        "robot.urdf", "export.json", "build",
    }  # fmt: skip


def test_cmake_builds_tests_and_installs_it(tmp_path: Path) -> None:
    if not shutil.which("cmake"):
        pytest.skip("without cmake")
    folder, build, user = exported(tmp_path / "out"), tmp_path / "build", tmp_path / "user"
    said_by("cmake", "-B", build, "-S", folder, "-Darm_NATIVE=ON")
    said_by("cmake", "--build", build)
    assert "100% tests passed" in said_by("ctest", "--test-dir", build)
    said_by("cmake", "--install", build, "--prefix", tmp_path / "prefix")
    user.mkdir()
    (user / "main.cpp").write_text(
        '#include "arm.h"\nint main() { double q[ARM_JOINTS] = {}, g[ARM_JOINTS];\n'
        "arm_gravity(q, g); return !(g[0] == g[0]); }\n"
    )
    (user / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.16)\nproject(user C CXX)\nfind_package(arm REQUIRED)\n"
        "add_executable(user main.cpp)\ntarget_link_libraries(user PRIVATE arm::arm)\n"
    )
    path = f"-DCMAKE_PREFIX_PATH={tmp_path / 'prefix'}"
    said_by("cmake", "-B", user / "build", "-S", user, path)
    said_by("cmake", "--build", user / "build")
    said_by(user / "build/user")


ODD = ('q"uote', "back\\slash", "a??/", "größe", "end */ of")


def test_names_of_robot_and_joints_cannot_break_the_code(tmp_path: Path) -> None:
    """As strings they are what they were; a comment ends where it should."""
    mass = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1'/></inertial>"
    joints = "".join(
        f"<link name='l{k}'>{mass}</link><joint name={quoteattr(name)} type='continuous'>"
        f"<parent link='{f'l{k - 1}' if k else 'base'}'/><child link='l{k}'/></joint>"
        for k, name in enumerate(ODD)
    )
    urdf = f"<robot name='*/ int x; /*'><link name='base'/>{joints}</robot>"
    (tmp_path / "odd.urdf").write_text(urdf)
    export(tmp_path / "odd.urdf", tmp_path / "out", "arm", ("gravity",), False, frames=ODD[-1:])
    for language in (C11, CPP17):
        said_by("cc", *language, *STRICT, "-Werror", "-fsyntax-only", tmp_path / "out" / "arm.c")
    loaded = Library(tmp_path / "out", "arm", (*C11, *BITS)).loaded
    names = (ctypes.c_char_p * len(ODD)).in_dll(loaded, "arm_joint_names")
    assert tuple(name.decode() for name in names) == ODD


def test_the_command_says_what_it_wrote(tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    result = CliRunner().invoke(main, ["export", SCENE, "--out", out, "--name", "arm"])
    assert result.exit_code == 0 and "library 'arm', 7 files" in result.output
    header = (tmp_path / "out/arm.h").read_text()
    assert "arm_inverse_dynamics" in header and "arm_sim_step" not in header


def test_a_condition_that_is_not_understood_is_refused() -> None:
    for lines in (
        "#if 1", "#if X > 0", "#ifdef X\n#elif Y", "#ifdef X\n#undef X", "#define Y(x) x\n#if Y"
    ):  # fmt: skip
        with pytest.raises(ValueError, match=re.escape(repr(lines.split("\n")[-1]))):
            without_decided_conditions(f"#define X 1\n{lines}\n#endif\n")
