# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions in xacro: expanded where xacro is installed, else refused with what to do."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import models
from arm_dynamics import ArmModel, SceneError, load_scene
from arm_dynamics.scene.urdf import xacro

URDF = (models.FOLDER / "planar_3r.urdf").read_text()
PROGRAM = f"""#!{sys.executable}
import sys
text = open(sys.argv[1]).read()
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


def test_without_xacro_the_message_says_what_to_do(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(SceneError, match="not installed: install it .*'xacro arm.urdf.xacro > "):
        load_scene(source)


def test_one_that_never_ends_is_given_up(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (source.parent / "bin" / "xacro").write_text(
        f"#!{sys.executable}\nimport time\ntime.sleep(60)"
    )
    monkeypatch.setattr(xacro, "_LONGEST", 0.2)
    with pytest.raises(SceneError, match="did not expand '.*arm.urdf.xacro' in 0.2 s"):
        load_scene(source)


def test_text_is_never_expanded() -> None:
    """It may come from a message, and xacro reads files."""
    call = '<link name="base"/><xacro:include filename="/etc/passwd"/><xacro:arm/>'
    with pytest.raises(SceneError, match="<xacro:arm> is not expanded: expand it with 'xacro "):
        load_scene(URDF.replace('<link name="base"/>', call))


def test_the_real_program(tmp_path: Path) -> None:
    pytest.importorskip("xacro")
    (tmp_path / "arm.urdf.xacro").write_text(
        SOURCE.replace("<robot ", '<robot xmlns:xacro="http://ros.org/wiki/xacro" ', 1)
    )
    expanded = ArmModel(load_scene(tmp_path / "arm.urdf.xacro"))
    assert expanded.whole == ArmModel(load_scene(URDF)).whole
