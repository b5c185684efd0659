# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions in xacro: expanded where xacro is installed, else refused with what to do."""

import sys
from pathlib import Path
from typing import Any

import pytest

import models
from arm_dynamics import ArmModel, SceneError, load_scene
from arm_dynamics.scene.urdf import xacro

URDF = (models.FOLDER / "planar_3r.urdf").read_text()
PROGRAM = f"""#!{sys.executable}
import re, sys
text = open(sys.argv[1]).read()
if "--deps" in sys.argv:
    sys.exit(print(" ".join(re.findall("include filename='(.*?)'", text))))
for name, value in (word.split(":=") for word in sys.argv[2:]):
    text = text.replace(f"$(arg {{name}})", value)
if "$(" in text:
    sys.exit("error: undefined substitution argument\\nwhen processing " + sys.argv[1])
print("warning: deprecated", file=sys.stderr)
print(text.replace("${{weight}}", "2").replace("<xacro:property name='weight' value='2'/>", ""))
"""
SOURCE = URDF.replace('<mass value="2"/>', '<mass value="${weight}"/>').replace(
    '<link name="base"/>', "<xacro:property name='weight' value='2'/><link name=\"base\"/>"
)


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A xacro file, and a program that expands it by the name of the real one."""
    assert SOURCE.count("weight") == 2
    program = tmp_path / "bin" / "xacro"
    program.parent.mkdir()
    program.write_text(PROGRAM)
    program.chmod(0o755)
    monkeypatch.setattr(xacro, "find_spec", lambda _: None)
    monkeypatch.setenv("PATH", str(program.parent))
    (tmp_path / "arm.urdf.xacro").write_text(SOURCE)
    return tmp_path / "arm.urdf.xacro"


def test_a_xacro_file_is_expanded(source: Path) -> None:
    expected = ArmModel(load_scene(URDF)).whole
    for given in (source, {"robot": {"urdf": str(source)}}):
        assert ArmModel(load_scene(given)).whole == expected


def test_what_xacro_says_is_told(source: Path) -> None:
    source.write_text("<robot>$(arg name)</robot>")
    with pytest.raises(SceneError, match=r"cannot expand '.*arm.urdf.xacro': error: undefined"):
        load_scene(source)


def with_arguments(source: Path, key: str = "xacro", **arguments: Any) -> ArmModel:
    robot = {key: str(source), "arguments": arguments}
    return ArmModel(load_scene({"robot": robot}))


def test_arguments_are_given_to_it(source: Path) -> None:
    (source.parent / "args.xacro").write_text("<xacro:arg name='mass' default='2'/>")
    (source.parent / "arm.txt").write_text(
        SOURCE.replace("${weight}", "$(arg mass)")
        .replace('name="planar_3r"', 'name="$(arg name)"')
        .replace("</robot>", f"<xacro:include filename='{source.parent}/args.xacro'/></robot>")
    )
    found = with_arguments(source.parent / "arm.txt", mass=2.5, name=True)
    assert found.whole.inertias[2].mass == 2.5 and found.whole.name == "true"
    assert load_scene(found.scene.model_dump(exclude_unset=True)) == found.scene
    (source.parent / "arm.txt").rename(source)
    assert with_arguments(source, "urdf", mass="2.5", name="arm").whole.name == "arm"


def test_arguments_that_it_has_not_are_refused(source: Path) -> None:
    """The real program ignores them."""
    source.write_text(SOURCE.replace("</robot>", "<xacro:arg default='a' name='side'/></robot>"))
    with pytest.raises(SceneError, match=r"arguments.sid': '.*xacro' has no such .*mean 'side'"):
        with_arguments(source, side="left", sid="left")


def test_a_source_is_a_urdf_or_a_xacro_file() -> None:
    for robot, words in (
        ({"urdf": "a.urdf", "xacro": "a.xacro"}, "'urdf' or 'xacro' is expected, not both"),
        ({"xacro": "a", "arguments": {"a": [1]}}, "robot.arguments.a' = .1.: text, a number"),
        ({"urdf": URDF, "arguments": {"a": 1}}, "give the file as 'robot.xacro'"),
    ):
        with pytest.raises(SceneError, match=words):
            load_scene({"robot": robot})


def test_without_xacro_the_message_says_what_to_do(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(SceneError, match="not installed: install it .*'xacro arm.urdf.xacro > "):
        load_scene(source)
    with pytest.raises(SceneError, match="'xacro arm.urdf.xacro side:=left > arm.urdf'"):
        with_arguments(source, side="left")


def test_one_that_never_ends_is_given_up(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (source.parent / "bin" / "xacro").write_text(
        f"#!{sys.executable}\nimport time\ntime.sleep(60)"
    )
    monkeypatch.setattr(xacro, "_TIMEOUT", 0.2)
    with pytest.raises(SceneError, match="did not expand '.*arm.urdf.xacro' in 0.2 s"):
        load_scene(source)


def test_text_is_never_expanded() -> None:
    """It may come from a message, and xacro reads files."""
    call = '<link name="base"/><xacro:include filename="/etc/passwd"/><xacro:arm/>'
    text = URDF.replace('<link name="base"/>', call)
    renamed = text.replace("<robot ", '<robot xmlns:x="http://ros.org/xacro" ')
    for source in (text, renamed.replace("<xacro:", "<x:")):
        with pytest.raises(SceneError, match="<xacro:arm> is not expanded: expand it with 'xacro"):
            load_scene(source)
