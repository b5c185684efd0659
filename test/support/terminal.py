# SPDX-License-Identifier: Apache-2.0
"""Types lines of a shell as a reader of a page would, and ends what they have started.

``arm`` and ``ros2`` are found on the PATH, ``./arm`` in the folder. Commands that go on until
Ctrl-C are watched until they work. Nodes then go on, so that later lines find them; recorders go
on until a line names their file; the others are interrupted at once.
"""

import json
import os
import re
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import Any

import ros2
from forging import asking
from harness import Ros, surroundings
from rcl_interfaces.srv import ListParameters
from sensor_msgs.msg import JointState
from typed import Typed

from arm_dynamics import InvalidInput
from arm_sim import Recording

ROOT = Path(__file__).parents[2]
PATIENCE = 200.0  # [s] for a line, on a machine that does other things
AGAIN = 3.0  # [s] after which a node is asked again
_ARM = f"""#!/bin/sh
if [ "$1" = python ]; then
    shift
    case "$*" in *benchmarks*) cd {ROOT} ;; esac
    exec {sys.executable} "$@"
fi
if [ "$1" = compare-controllers ]; then set -- controllers "$@"; fi
case $1 in
    bench) shift; cd {ROOT}; exec {sys.executable} -m benchmarks "$@" ;;
    stress) cd {ROOT}; exec {sys.executable} -m benchmarks."$@" ;;
    controllers) shift 2; cd {ROOT}; exec {sys.executable} -m benchmarks.controllers "$@" ;;
esac
"""

_NODE = re.compile(
    r"(?:\./arm|ros2 run \w+) (?=sim\b|controller\b|dynamics\b)(\w+)|\./arm python (\w+_node)\.py"
)
_SHOWN = re.compile(r"^(?!.*--once).*arm (?:watch|view)\b")
_PICTURES = re.compile(r"--(?:html|png|gif|mp4)\b")
_RECORDER = re.compile(r"arm record\b.*--out (\S+)")


def _has_states(file: Path) -> bool:
    """Whether a recorder has received a state; its file names the topics before that."""
    try:
        return file.is_file() and len(Recording.load(file)) > 1
    except InvalidInput:
        return False


class Terminal:
    """A folder with a shell, a Python that stays, and a ROS domain of its own."""

    def __init__(self, folder: Path, forge: Path) -> None:
        self.folder = folder
        tools = folder / ".tools"
        tools.mkdir()
        for tool, before in {"arm": _ARM, "ros2": "#!/bin/sh\n"}.items():
            ask = " ".join(map(str, asking(forge)))
            (tools / tool).write_text(f'{before}exec {ask} {tool} "$@"\n')
            (tools / tool).chmod(0o755)
        (folder / "arm").symlink_to(tools / "arm")
        self._forge = forge
        self._ros: Ros | None = None
        self._python: subprocess.Popen[str] | None = None
        self._running: dict[str, Typed] = {}
        self._recorders: list[str] = []
        self._environment = surroundings(
            MPLBACKEND="Agg", PATH=f"{tools}:{os.environ['PATH']}",
            ROS_LOG_DIR=str(folder / ".ros"), COLUMNS="100",
            PYTHONPATH=f"{folder}:{os.environ.get('PYTHONPATH', '')}",
        )  # fmt: skip

    def python(self, text: str) -> str:
        """Run a block in the Python of the page; returns what it printed."""
        if self._python is None:
            self._python = subprocess.Popen(
                [*asking(self._forge), "page"], cwd=self.folder, env=self._in_domain(),
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            )  # fmt: skip
        assert self._python.stdin and self._python.stdout
        self._python.stdin.write(json.dumps(text) + "\n")
        self._python.stdin.flush()
        said = []
        while (line := self._python.stdout.readline()) != "\0done\n":
            assert line, "".join(said)[-3000:]
            said.append(line)
        return "".join(said)

    def type(self, line: str, status: int = 0) -> str:
        """Type a line; returns what it printed until it ended, with a status, or worked."""
        for file in [file for file in self._recorders if file in line.split()]:
            self._recorders.remove(file)
            self._end(file)  # the recording is to be read
        if found := _NODE.search(line):
            name = re.search(r"__node:=(\w+)", line)
            return self._node(name[1] if name else found[1] or found[2], line)
        if (found := _RECORDER.search(line)) and "--duration" not in line:
            started = self._begin(found[1], line)
            self._recorders.append(found[1])
            started.until(lambda: _has_states(self.folder / found[1]))
            return started.said
        if line.startswith("ros2") and not line.startswith("ros2 run"):
            return self._ros2(line)
        if _SHOWN.search(line) and not _PICTURES.search(line):
            return self._first_words(line)
        return self._to_the_end(line, status)

    def close(self) -> None:
        """End everything, the last first."""
        try:
            for name in reversed(list(self._running)):
                self._end(name)
        finally:
            for started in self._running.values():
                started.end()
            if self._python is not None:
                self._python.communicate(timeout=PATIENCE)
            if self._ros is not None:
                self._ros.close()

    # --- how lines are run ---------------------------------------------------------------------

    def _in_domain(self) -> dict[str, str]:
        if self._ros is None:
            self._ros = Ros()
        return self._environment | {"ROS_DOMAIN_ID": str(self._ros.domain)}

    def _begin(self, name: str, line: str) -> Typed:
        self._running[name] = Typed(line, self.folder, self._in_domain(), screen=False)
        return self._running[name]

    def _end(self, name: str) -> None:
        """Press Ctrl-C, at which it must end in an orderly way."""
        typed = self._running.pop(name)
        assert typed.end() in (0, 130), f"$ {typed.line}\n{typed.said[-3000:]}"

    def _node(self, name: str, line: str) -> str:
        """A node that goes on, in place of one of its name; it works when it answers."""
        if name in self._running:
            if self._running[name].line == line:
                return self._running[name].said
            self._end(name)
        started = self._begin(name, line)
        assert self._ros is not None
        ros, known = self._ros, f"/{name}/list_parameters"
        client = ros.peer.create_client(ListParameters, known)
        futures: list[Any] = []
        asked = -AGAIN

        def answers() -> bool:
            nonlocal asked
            ros.spin_once()
            now = time.monotonic()
            if client.service_is_ready() and now - asked > AGAIN:  # an answer may get lost
                futures.append(client.call_async(ListParameters.Request()))
                asked = now
            return any(future.done() for future in futures)

        started.until(answers)
        ros.peer.destroy_client(client)
        if name == "controller" and "sim" in self._running:
            self._listen(ros)
        return started.said

    def _listen(self, ros: Ros) -> None:
        """Wait until the controller has seen a state and answers it; of a paused sim, not long."""
        heard, end = list[JointState](), time.monotonic() + AGAIN
        listening = ros.peer.create_subscription(JointState, "joint_commands", heard.append, 1)
        while not heard and time.monotonic() < end:
            ros.spin_once()
        ros.peer.destroy_subscription(listening)

    def _ros2(self, line: str) -> str:
        """What ``ros2`` says to words as the shell passes them on."""
        words = self._to_the_end(f"words() {{ printf '%s\\0' \"$@\"; }}; words {line}", 0)
        assert self._ros is not None
        return ros2.do(self._ros, words.split("\0")[1:-1])

    def _first_words(self, line: str) -> str:
        started = self._begin(line, line)
        sign = "http://" if "arm view" in line else "\n"
        started.until(lambda: sign in started.said)
        if page := re.search(r"http://\S+", started.said):
            with urllib.request.urlopen(page[0], timeout=PATIENCE) as answer:
                assert answer.status == 200
        self._end(line)
        return started.said

    def _to_the_end(self, line: str, status: int) -> str:
        done = subprocess.run(
            ["bash", "-c", line], cwd=self.folder, env=self._in_domain(), timeout=PATIENCE,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        assert done.returncode == status, f"$ {line}\n{done.stdout[-3000:]}"
        return done.stdout
