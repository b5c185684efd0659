# SPDX-License-Identifier: Apache-2.0
"""Runs tests with all native code built with sanitizers: the events' engine, the nodes' messages.

    ./arm python tools/sanitize.py                  addresses and undefined behaviour, some minutes
    ./arm python tools/sanitize.py thread           data races
    ./arm python tools/sanitize.py --fuzz 100       a hundred times as many malformed inputs
    ./arm python tools/sanitize.py address TEST…    other tests; arguments go to pytest

The code is compiled as always, by a compiler that is told to instrument it, into a cache that is
deleted at the end. Python itself is not instrumented: the sanitizer's library is loaded first, and
Python's memory comes from malloc, so that reading past the end of a message is noticed. Races are
seen only between accesses in our own C; ``test_tick_threads.py`` does in C what the threads of a
node do in Python. The first finding ends the run, and its report is printed.
"""

import os
import subprocess
import sys
import tempfile
from argparse import ArgumentParser
from pathlib import Path

ROOT = Path(__file__).parents[1]
NODES = [
    "test/arm_dynamics/ros/test_fuzz.py",
    "test/arm_dynamics/ros/test_joint_state.py",
    "test/arm_dynamics/ros/test_compiled_services.py",
    "test/arm_dynamics/ros/test_compiled_answers.py",
]
SIM = [
    "test/arm_sim/ros/test_order_sequences.py",
    "test/arm_sim/ros/test_realtime_loop.py",
    "test/arm_sim/ros/test_tick_recorder.py",
    "test/arm_sim/ros/test_tick_threads.py",
]
ENGINE = [
    "test/arm_sim/stepping/test_fuzz.py",
    "test/arm_sim/stepping/test_cone.py",
    "test/arm_sim/stepping/test_search.py",
    "test/arm_sim/stepping/test_adaptive.py",
    "test/arm_studies/optimization/test_ilqr.py",
]
CALLS = [
    "test/arm_dynamics/dynamics/test_one_state.py::test_refuses_the_same_with_the_same_words",
    "test/arm_dynamics/dynamics/test_one_state.py::test_however_numbers_are_given",
    "test/arm_dynamics/dynamics/test_one_state.py::test_memory_lives_as_long_as_the_function",
    "test/arm_sim/stepping/test_python_step.py",
]
# Of each sanitizer: flags, libraries that must be loaded first, options, what has tests for it.
KINDS = {
    "address": (
        "-fsanitize=address,undefined -fno-sanitize-recover=undefined",
        ("libasan.so", "libubsan.so", "libstdc++.so.6"),
        {"ASAN_OPTIONS": "detect_leaks=0", "UBSAN_OPTIONS": "print_stacktrace=1"},
        [*NODES, *SIM, *ENGINE, *CALLS],
    ),
    "thread": (
        "-fsanitize=thread",
        ("libtsan.so", "libstdc++.so.6"),
        # Fast DDS synchronizes by atomics, which are not seen in code that is not instrumented.
        {"TSAN_OPTIONS": "halt_on_error=1 ignore_noninstrumented_modules=1"},
        [*NODES, *SIM],
    ),
}
# Instrumented code of a large arm takes minutes to compile, and so does that of all controllers.
SMALL = "not panda and not every_controller"


def main() -> int:
    """Run it, and return pytest's exit status."""
    parser = ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("kind", nargs="?", choices=KINDS, default="address")
    parser.add_argument("--fuzz", default="1", help="factor for the number of malformed inputs")
    chosen, tests = parser.parse_known_args()
    flags, libraries, options, usual = KINDS[chosen.kind]
    with tempfile.TemporaryDirectory(prefix="sanitize-") as cache:
        environment = {
            **os.environ, **options, "CC": f"gcc -g {flags}", "CXX": f"g++ -g {flags}",
            "XDG_CACHE_HOME": cache, "PYTHONMALLOC": "malloc",
            "LD_PRELOAD": ":".join(map(_library, libraries)),
            "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
        }  # fmt: skip
        pytest = [sys.executable, "-m", "pytest", "-p", "_hypothesis_pytestplugin", "-xsq"]
        named = any(not word.startswith("-") for word in tests)
        picked = tests if named else [*usual, "-k", SMALL, *tests]
        # Threads are watched by addresses that must not be drawn at random.
        fixed = ["setarch", "-R"] if chosen.kind == "thread" else []
        command = [*fixed, *pytest, "--fuzz", chosen.fuzz, *picked]
        return subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode


def _library(name: str) -> str:
    found = subprocess.run(
        ["gcc", f"-print-file-name={name}"], capture_output=True, text=True, check=True
    )
    return found.stdout.strip()


if __name__ == "__main__":
    sys.exit(main())
