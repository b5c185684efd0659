# SPDX-License-Identifier: Apache-2.0
"""Runs commands in processes that need not import the suite: children of one that has.

A start of Python with Pinocchio, CasADi and rclpy takes a second and more of a processor, and the
pages have many lines. The server imports everything once and forks for each. ``forge.py SOCKET
WORDS…`` hands over its folder, environment and files, passes Ctrl-C and SIGTERM on, and ends like
the child.
"""

import array
import ctypes
import json
import os
import re
import runpy
import select
import signal
import socket
import sys
from importlib import import_module
from pathlib import Path

SRC = Path(__file__).parents[2] / "src"
_PR_SET_PDEATHSIG = 1


def ask(path: str, words: list[str]) -> int:
    """Run a command in the server as if this process ran it; returns the exit status."""
    request = {"words": words, "folder": os.getcwd(), "environment": dict(os.environ)}
    text = json.dumps(request).encode()
    files = array.array("i", [0, 1, 2]).tobytes()
    with socket.socket(socket.AF_UNIX) as server:
        server.connect(path)
        rights = (socket.SOL_SOCKET, socket.SCM_RIGHTS, files)
        server.sendmsg([b"%d\n" % len(text)], [rights])
        server.sendall(text)
        answers = server.makefile()
        child = int(answers.readline())
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda number, _: os.kill(child, number))
        return int(answers.readline())


def serve(path: str) -> None:
    """Fork for each request, until killed."""
    _end_with_parent()
    import matplotlib.pyplot  # noqa: F401

    import arm_dynamics.ros.controller_node.node
    import arm_dynamics.ros.dynamics_node.node  # noqa: F401
    import arm_sim.ros.sim_node.node  # noqa: F401
    import arm_studies.cli.main  # noqa: F401

    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    with socket.socket(socket.AF_UNIX) as door:
        door.bind(path)
        door.listen()
        while True:
            asking, _ = door.accept()
            if os.fork() == 0:
                _end_with_parent()
                door.close()
                _attend(asking)
                os._exit(0)
            asking.close()


def _end_with_parent() -> None:
    """Have the kernel kill this process when its parent ends, however that ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def _attend(asking: socket.socket) -> None:
    """Run the command in a child process, which is killed when its client ends."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    head, files, _, _ = socket.recv_fds(asking, 64, 3)
    size, _, text = head.partition(b"\n")
    while len(text) < int(size):
        text += asking.recv(1 << 20)
    child = os.fork()
    if child == 0:
        _end_with_parent()
        asking.close()
        _become(json.loads(text), files)
    asking.sendall(b"%d\n" % child)
    ended = os.pidfd_open(child)
    ready, _, _ = select.select([ended, asking], [], [])
    if ended not in ready:
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    if ended in ready:
        asking.sendall(b"%d\n" % os.waitstatus_to_exitcode(status))


def _become(request: dict, files: list[int]) -> None:
    """Run the command in this process, with the folder, environment and files of the client."""
    for standard, given in enumerate(files):
        os.dup2(given, standard)
    os.setsid()
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    sys.path[:0] = os.environ["PYTHONPATH"].split(os.pathsep)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    tool, *words = request["words"]
    sys.argv = [tool, *words]
    status = 1
    try:
        _tools()[tool](words)
        status = 0
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
    except KeyboardInterrupt:
        status = 130
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def _tools() -> dict:
    from arm_studies.cli.main import main

    return {
        "arm": lambda words: main(words, prog_name="./arm"),
        "ros2": _executable,
        "page": _blocks,
        "script": _script,
    }


def _executable(words: list) -> None:
    """Do as ``ros2 run PACKAGE EXECUTABLE …``, with an executable of a package's ``setup.py``."""
    _, package, executable, *rest = words
    text = (SRC / package / "setup.py").read_text()
    ((module, function),) = re.findall(rf'"{executable} = ([\w.]+):(\w+)"', text)
    sys.argv = [executable, *rest]
    sys.exit(getattr(import_module(module), function)())


def _blocks(_: list) -> None:
    """Run the blocks of a page, a line of JSON each, and say when each is done."""
    page = {"__name__": "__main__"}
    for line in sys.stdin:
        exec(compile(json.loads(line), "the page", "exec"), page)
        print("\0done", flush=True)


def _script(words: list) -> None:
    """Run a script as ``python -P`` does."""
    sys.argv = words
    runpy.run_path(words[0], run_name="__main__")


if __name__ == "__main__":
    if sys.argv[2:]:
        sys.exit(ask(sys.argv[1], sys.argv[2:]))
    serve(sys.argv[1])
