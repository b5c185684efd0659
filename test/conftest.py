# SPDX-License-Identifier: Apache-2.0
"""Fixtures that every test may use."""

import fcntl
import os
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from zlib import crc32

import casadi as ca
import numpy as np
import pytest

import models
from arm_dynamics.codegen.one_at_a_time import is_building

# Modules of the packages that ./arm installs only when asked for, by group.
GROUPS = {
    "bench": ("mujoco",),
    "fmu": ("fmpy", "fmuloader"),
    "jax": ("jax",),
    "sweep": ("distributed", "joblib", "pyarrow"),
    "view": ("collada", "playwright", "viser"),
}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let a failing random test be repeated with its seed, and tests that bend input be long."""
    parser.addoption("--seed", type=int, default=None, help="seed of the random generators")
    parser.addoption("--fuzz", type=int, default=1, help="how many times as many bent inputs")
    parser.addoption("--nightly", action="store_true", help="all of what is otherwise sampled")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Processes to run folders of tests, more than cores, since many tests wait for processes of
    theirs; a few files are quicker in this one.
    """
    return len(os.sched_getaffinity(0)) + 2 if any(map(os.path.isdir, config.args)) else 0


# Files whose tests take long each and share nothing: they are shared out one by one.
ONE_BY_ONE = ("test/docs/test_pages_run.py", "test/docs/test_examples.py")
# Where tests start processes and wait for them.
WAITING = (*ONE_BY_ONE, "test/packages/", "test/benchmarks/", "test/arm_sim/cli/", "test/docs/")
# What goes by the clock and shares the machine with no other test: last, so that none waits.
ALONE = ("test/arm_sim/cli/test_demo.py::test_the_loop_closes",)


def scope(nodeid: str) -> str:
    """What stays in one process: the tests of a file, which share what they have built."""
    file = nodeid.split("::", 1)[0]
    if nodeid.startswith(ALONE):
        return "alone"
    return nodeid if file in ONE_BY_ONE else file


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what belongs to long runs; where several processes run tests, begin with what
    takes longest, and let those that wait and those that compute take turns.
    """
    if not config.getoption("--nightly"):
        left_out = [item for item in items if item.get_closest_marker("nightly")]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if not item.get_closest_marker("nightly")]
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return
    sizes = Counter(item.path for item in items)

    def rank(item: pytest.Item) -> tuple[int, int]:
        first = [k for k, place in enumerate(WAITING) if item.nodeid.startswith(place)]
        waits = len(WAITING) + (item.get_closest_marker("ros") is None)
        return min(first, default=waits), -sizes[item.path]

    items.sort(key=rank)
    turns: dict[str, int] = {}
    counts = Counter[bool]()
    for item in items:
        if (part := scope(item.nodeid)) not in turns:
            computes = rank(item)[0] > len(WAITING)
            turns[part] = counts[computes]
            counts[computes] += 1
    items.sort(key=lambda item: (scope(item.nodeid) == "alone", turns[scope(item.nodeid)]))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Share the tests out by scopes, in the order of ``pytest_collection_modifyitems``."""
    from xdist.scheduler import LoadScopeScheduling

    config.option.loadscopereorder = False

    class ByScope(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return scope(nodeid)

    return ByScope(config, log)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip tests of a group of packages that is not installed; CI installs it and runs them."""
    for marker in item.iter_markers("group"):
        (group,) = marker.args
        if missing := [name for name in GROUPS[group] if find_spec(name) is None]:
            pytest.skip(f"without {', '.join(missing)}, which './arm setup {group}' installs")


@pytest.fixture(autouse=True)
def room(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[None]:
    """Where several processes run tests, one that is alone waits until the others are idle, and
    keeps none of them waiting for that.
    """
    if "PYTEST_XDIST_WORKER" not in os.environ:
        yield
        return
    alone = scope(request.node.nodeid) == "alone"
    folder = tmp_path_factory.getbasetemp().parent  # what the processes of a run share
    with (folder / "room").open("w") as inside:
        fcntl.flock(inside, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        yield


# Shells ignore it for what they start in the background, and so would all that tests start.
signal.signal(signal.SIGINT, signal.default_int_handler)

_SRC = str(Path(__file__).resolve().parents[1] / "src")


def _in_turn(make: Callable[..., Any]) -> Callable[..., Any]:
    """As ``make``; the suite itself may call it only where threads take turns."""

    def checked(*args: Any, **kwargs: Any) -> Any:
        if sys._getframe(1).f_code.co_filename.startswith(_SRC):
            assert is_building(), "expressions are built outside one_at_a_time"
        return make(*args, **kwargs)

    return checked


for _kind in (ca.SX, ca.MX):
    _kind.sym = staticmethod(_in_turn(_kind.sym))


@pytest.fixture(scope="session")
def forge(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Socket of what starts programs of the suite without importing it again."""
    from forging import forging

    with forging(tmp_path_factory.mktemp("forge")) as made:
        yield made


@pytest.fixture(scope="session")
def hasty(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment with compilers that do not optimize, which takes a third of the time."""
    folder = tmp_path_factory.mktemp("hasty")
    for command in ("cc", "c++"):
        (folder / command).write_text(f'#!/bin/sh\nexec {command} "$@" -O0\n')
        (folder / command).chmod(0o700)
    return {"CC": str(folder / "cc"), "CXX": str(folder / "c++")}


@pytest.fixture
def server() -> Iterator[Any]:
    """A page's server, for what is drawn on it."""
    from arm_sim.view.server import close_server, open_server

    opened = open_server("arm", port=0)
    yield opened
    close_server(opened)


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """A generator of its own for each test, the same on every run; the seed shows when the test
    fails.
    """
    given = request.config.getoption("--seed")
    name = request.node.nodeid.partition("::")[2]  # stays the same when a file moves
    seed = crc32(name.encode()) if given is None else given
    print(f"random numbers: repeat with --seed={seed}")
    return np.random.default_rng(seed)


@pytest.fixture
def fuzz(request: pytest.FixtureRequest) -> int:
    """How many times as long tests that bend input at random shall be."""
    return int(request.config.getoption("--fuzz"))


@pytest.fixture(params=models.ROBOTS)
def robot(request: pytest.FixtureRequest) -> str:
    """The name of each robot in turn, for ``models.dynamics`` and its neighbours."""
    return str(request.param)
