# SPDX-License-Identifier: Apache-2.0
"""Reads launch files as ROS 2 Jazzy documents them: what would be started, and with what.

Source: "Migrating Launch Files" and "Using XML, YAML, and Python for ROS 2 Launch Files" of ROS 2
Jazzy's documentation; the library ``launch`` is in no registry.
"""

import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import yaml

# Tags that our files have, with their attributes and their children.
TAGS: dict[str, tuple[set[str], set[str]]] = {
    "launch": (set(), {"arg", "node", "include", "group"}),
    "group": ({"if"}, {"node", "include", "push_ros_namespace"}),
    "arg": ({"name", "default", "value", "description"}, set()),
    "include": ({"file", "if"}, {"arg"}),
    "push_ros_namespace": ({"namespace"}, set()),
    "node": (
        {"pkg", "exec", "name", "namespace", "args", "output", "respawn", "if"},
        {"param", "remap"},
    ),
    "param": ({"name", "value", "from", "type"}, set()),
    "remap": ({"from", "to"}, set()),
}


class Start(NamedTuple):
    """A node that a launch file would start."""

    package: str
    executable: str
    namespace: str  # such as ``/left``
    name: str  # perhaps empty
    words: tuple[str, ...]  # words of its own on the command line
    files: tuple[Path, ...]  # parameter files, in order
    parameters: dict[str, object]  # by name, typed
    remaps: dict[str, str]  # new names of topics


@dataclass
class Launch:
    """A launch file that is being read."""

    share: dict[str, Path]  # folders of packages by name
    # Carries out a command of ``$(command …)`` and gives what it prints
    run: Callable[[str], str] = lambda line: subprocess.check_output(line, shell=True, text=True)
    started: list[Start] = field(default_factory=list)

    def read(self, path: Path, given: dict[str, str], namespace: str = "") -> list[Start]:
        """Everything that a launch file starts, with arguments that it is given."""
        root = ElementTree.parse(path).getroot()
        assert root.tag == "launch"
        declared = {arg.get("name") for arg in root.findall("arg")}
        assert set(given) <= declared, f"{path.name} has no argument {set(given) - declared}"
        self._children(root, dict(given), namespace)
        return self.started

    def _children(self, parent: ElementTree.Element, known: dict[str, str], space: str) -> None:
        for child in parent:
            assert child.tag in TAGS[parent.tag][1], f"<{child.tag}> in <{parent.tag}>"
            assert set(child.attrib) <= TAGS[child.tag][0], child.attrib
            if self.text(child.get("if", "true"), known) == "false":
                continue
            match child.tag:
                case "arg":
                    assert "default" in child.attrib or child.attrib["name"] in known
                    default = self.text(child.get("default", ""), known)
                    known.setdefault(child.attrib["name"], default)
                case "push_ros_namespace":
                    space += "/" + self.text(child.attrib["namespace"], known).strip("/")
                case "group":
                    self._children(child, dict(known), space)
                case "include":
                    passed = {a.attrib["name"]: self.text(a.attrib["value"], known) for a in child}
                    inside = Launch(self.share, self.run, self.started)
                    inside.read(Path(self.text(child.attrib["file"], known)), passed, space)
                case "node":
                    self._node(child, known, space)

    def _node(self, node: ElementTree.Element, known: dict[str, str], space: str) -> None:
        files, parameters, remaps = [], {}, {}
        for child in node:
            assert child.tag in TAGS["node"][1]
            assert set(child.attrib) <= TAGS[child.tag][0], child.attrib
            said = {key: self.text(value, known) for key, value in child.attrib.items()}
            if child.tag == "remap":
                remaps[said["from"]] = said["to"]
            elif "from" in said:
                assert len(said) == 1, "name and from exclude each other"
                files.append(Path(said["from"]))
            else:
                text = said.get("type") == "str"
                parameters[said["name"]] = said["value"] if text else yaml.safe_load(said["value"])
        own = self.text(node.get("namespace", ""), known)
        within = "" if own.startswith("/") else space.strip("/")
        self.started.append(
            Start(
                node.attrib["pkg"], node.attrib["exec"],
                "/" + "/".join(filter(None, (within, own.strip("/")))),
                self.text(node.get("name", ""), known),
                tuple(self.text(node.get("args", ""), known).split()),
                tuple(files), parameters, remaps,
            )
        )  # fmt: skip

    def text(self, written: str, known: dict[str, str]) -> str:
        """Text with its substitutions carried out."""

        def carried_out(found: re.Match[str]) -> str:
            match found[1]:
                case "var":
                    return known[found[2]]
                case "find-pkg-share":
                    return str(self.share[found[2]])
                case "command":
                    return self.run(found[2].strip("'"))
            raise AssertionError(f"substitution {found[0]}")

        inner = re.compile(r"\$\((var|find-pkg-share|command) ([^()$]*)\)")
        while (after := inner.sub(carried_out, written, count=1)) != written:
            written = after
            if "<robot" in written:  # what a command has printed is not read again
                break
        assert "$(" not in written or "<robot" in written, written
        return written


@cache
def by_python(line: str) -> str:
    """``ros2 run arm_sim arm …`` without ros2."""
    words = line.split()
    assert words[:4] == ["ros2", "run", "arm_sim", "arm"]
    command = [sys.executable, "-P", "-m", "arm_sim.cli", *words[4:]]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout
