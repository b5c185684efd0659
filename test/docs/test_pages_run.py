# SPDX-License-Identifier: Apache-2.0
"""What the pages show is done, from top to bottom, in a folder and a ROS domain of the page's own.

A block whose first line is a comment with a file's name is that file. Python is run, all of a page
in one process. Lines for a shell are typed, ``ros2`` included (``ros2.py`` stands in for it); what
they print is compared with what the page shows. ``lines_elsewhere.yaml`` has the lines that are
not typed as they stand, and why. Python after the comment ``<!-- not run: REASON -->`` is only
read.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import page_files
import pages
import pytest
import yaml
from browser import needed
from terminal import Terminal

pytestmark = pytest.mark.ros

PANDA = ("arm sim panda", "arm controller panda")
OTHER = "arm sim panda --ros-args -r __node:=robot_state_publisher -r joint_states:=elsewhere"
# What a reader has when a page begins: files by name, and nodes that run.
GIVEN: dict[str, tuple[str, ...]] = {
    "README": PANDA,
    "how-to/own-controller": ("my_package/my_module.py", "my_arm.urdf"),
    "how-to/compare": ("run.mcap", "bag_of_my_robot", "better.yaml"),
    "how-to/compiled-scenes": ("my_scene.yaml",),
    "how-to/excite": PANDA,
    "how-to/export": ("my_arm.urdf",),
    "how-to/fmu": ("my_arm.urdf",),
    "how-to/identify": ("run.mcap", "held.mcap", "bag_1", "bag_2", "table.csv", "arm.urdf"),
    "how-to/lockstep": ("run2.mcap",),
    "how-to/python-client": ("arm sim panda", "arm dynamics panda"),
    "how-to/recordings": ("other.mcap", "cut.mcap"),
    "how-to/shell": ("arm dynamics panda",),
    "how-to/stand-in": (OTHER,),
    "how-to/view": (*PANDA, "my_arm.urdf", "run.mcap", "bags/my_robot"),
    "reference/node-controller": ("arm sim panda",),
    "reference/ros-interface": (OTHER,),
    "tutorials/identify": (
        "my_arm.urdf", "arm sim my_arm.urdf", "arm controller my_arm.urdf", "other_run.mcap",
    ),
}  # fmt: skip
# Lines of a page that would go on among its others; test_own_node.py runs the node with its sim.
APART = {
    "README": (
        "./arm sim ur5e --ros-args -p gravity_compensated:=true", "./arm python my_node.py"
    ),
}  # fmt: skip
# Words that make a line quicker and change nothing else.
SHORTER = {
    r"arm excite\b": "--attempts 1 --period 4 --harmonics 3",
    r"arm view .*--png\b": "--size 160x100",
    r"arm view .*--gif\b": "--rate 1 --size 160x100",
}
# What is changed in the files of a page, for the same reason.
SMALLER = {"how-to/sweep": (r"samples: \d+", "samples: 3")}
# Exit statuses other than 0 that the pages explain: another method differs, a joint sticks.
STATUS = {r"arm replay .*--integrator\b": 1, r"arm go elbow_joint=1 wrist_1_joint=-0\.5": 1}
ELSEWHERE = yaml.safe_load((Path(__file__).parent / "lines_elsewhere.yaml").read_text())
HELP: dict[str, str] = {}  # what programs print about themselves
DRAWN = re.compile(r"arm view .*--(?:png|gif|mp4)\b")
# What needs a group of packages that ./arm installs only when asked for.
GROUPS = {
    "view": r"arm view\b|^from arm_sim\.view\b",
    "sweep": r"arm sweep\b",
    "jax": r"^import jax$",
}
# Numbers that differ from run to run: times, sizes, errors of a motion.
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
MEASURED = re.compile(r"\([\d.]+ m?s\)|[\d.]+ MB|(?<=error )\S+ at \w+|(?<=in )[\d.]+(?= s)")


def lines(page: Path) -> list[str]:
    return [step.text for step in pages.steps(page) if step.kind == "line"]


def elsewhere(line: str) -> dict[str, str | bool] | None:
    """The entry of the list for a line."""
    return next((entry for entry in ELSEWHERE if re.fullmatch(entry["lines"], line, re.S)), None)


@pytest.fixture(scope="module")
def shelf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where files that several pages are given are made once."""
    return tmp_path_factory.mktemp("shelf")


@pytest.fixture
def terminal(tmp_path: Path, forge: Path) -> Iterator[Terminal]:
    made = Terminal(tmp_path, forge)
    yield made
    made.close()


# Pages that take longest; other tests call their commands and functions as well.
LONG = (
    "how-to/excite", "how-to/identify", "how-to/shell", "how-to/view", "reference/node-controller",
    "tutorials/identify", "tutorials/replace-your-robot", "tutorials/sweep",
)  # fmt: skip
RUN = [page for page in pages.PAGES if any(pages.steps(page))]


def marks(page: Path) -> Iterator[pytest.MarkDecorator]:
    """The groups of packages that a page needs, and whether it takes long."""
    if pages.label(page) in LONG:
        yield pytest.mark.nightly
    done = [step.text for step in pages.steps(page) if not elsewhere(step.text)]
    for group, needs in GROUPS.items():
        if any(re.search(needs, text, re.M) for text in done):
            yield pytest.mark.group(group)


RUNS = [pytest.param(page, id=pages.label(page), marks=list(marks(page))) for page in RUN]


@pytest.mark.parametrize("page", RUNS)
def test_a_page_does_what_it_shows(page: Path, terminal: Terminal, shelf: Path) -> None:
    if any(map(DRAWN.search, lines(page))):
        needed()
    for given in GIVEN.get(pages.label(page), ()):
        if given.startswith("arm "):
            terminal.type(f"./{given}")
        else:
            page_files.put(given, terminal.folder, shelf)
    for step in pages.steps(page):
        in_ten_minutes = page.name == "start.md" and not step.text.startswith("./arm")
        if in_ten_minutes or step.text in APART.get(pages.label(page), ()):
            continue
        if step.kind == "file":
            text = re.sub(*SMALLER.get(pages.label(page), ("", "")), step.text)
            (terminal.folder / step.name).write_text(text)
        elif step.kind == "python":
            said = terminal.python(step.text)
            if step.shown:
                compare(said, step.shown)
        else:
            typed(step, terminal)


def compare(said: str, shown: str) -> None:
    """What Python printed is what the page shows; last digits may differ between machines."""
    assert NUMBER.sub("…", said).split() == NUMBER.sub("…", shown).split()
    numbers = [[float(x) for x in NUMBER.findall(text)] for text in (said, shown)]
    assert numbers[0] == pytest.approx(numbers[1], rel=0.05)


def typed(step: pages.Step, terminal: Terminal) -> None:
    """Type a line, and compare what it printed with what the page shows."""
    line, listed = step.text, elsewhere(step.text)
    if listed:
        if listed.get("help"):
            has_its_options(line, terminal)
        if module := re.search(r"-m (benchmarks[\w.]*)", line):
            place = pages.ROOT / module[1].replace(".", "/")
            assert place.is_dir() or place.with_suffix(".py").is_file()
        return
    for found, more in SHORTER.items():
        if re.search(found, line):
            line += f" {more}"
    status = next((end for found, end in STATUS.items() if re.search(found, line)), 0)
    said = terminal.type(line, status)
    if step.shown:
        rest = iter(words(said))  # progress may stand in between
        assert all(word in rest for word in words(step.shown)), f"$ {line}\n{said}"


def has_its_options(line: str, terminal: Terminal) -> None:
    """The help of a program, typed once for all pages, has the options of a line."""
    program, *options = re.split(r" (?=-)", line)
    if program not in HELP:
        HELP[program] = terminal.type(f"{program} --help")
    assert "Usage: " in HELP[program]
    assert [option for option in options if option.split()[0] not in HELP[program]] == []


def words(text: str) -> list[str]:
    """Words without numbers that differ from run to run."""
    return MEASURED.sub("…", text).split()


@pytest.mark.parametrize("entry", ELSEWHERE, ids=lambda entry: entry["lines"][:30])
def test_the_list_holds_nothing_else(entry: dict[str, str]) -> None:
    """Every entry is of a line that a page has, has a reason, and something that is there."""
    assert any(elsewhere(line) is entry for page in pages.PAGES for line in lines(page))
    assert entry["why"] and (pages.ROOT / entry["elsewhere"]).exists()


def test_what_pages_are_given_is_of_pages() -> None:
    assert set(GIVEN) <= {pages.label(page) for page in RUN}
    named = {name for given in GIVEN.values() for name in given if not name.startswith("arm ")}
    assert named == set(page_files.MAKERS)
