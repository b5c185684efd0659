# SPDX-License-Identifier: Apache-2.0
"""Scenes and names of the documentation exist, as do its links, and figures are those of
``docs/facts.yaml``.
"""

import re
import runpy
from functools import cache
from pathlib import Path

import pytest
import yaml

from arm_dynamics import ArmError
from arm_dynamics.scene import ready_scenes
from arm_sim import Simulator
from arm_studies.cli.main import main as suite

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*/*.md"), *(ROOT / "docs").glob("*.md")]
)
WIDTH = 100
REFERENCE = (ROOT / "docs/reference/scene.md").read_text()
FACTS = yaml.safe_load((ROOT / "docs/facts.yaml").read_text())


def test_pages_are_short_and_broken_into_lines() -> None:
    for page in PAGES:
        text = re.sub(r"```.*?```|\$\$.*?\$\$", "", page.read_text(), flags=re.DOTALL)
        lines = [x for x in text.splitlines() if not x.startswith(("|", "  |", "    ", "{{"))]
        long = [line for line in lines if len(line) > WIDTH and " " in line[:WIDTH].strip()]
        assert long == [], page
        of_users = page.parent.name not in {"laboratory", "project", ROOT.name}
        assert len(page.read_text().splitlines()) <= (300 if of_users else 10_000), page
    assert len((ROOT / "README.md").read_text().splitlines()) <= 120


def test_links_lead_somewhere() -> None:
    for page in PAGES:
        links = re.findall(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)", page.read_text())
        for link, part in links:
            if "://" not in link:
                target = page.parent / link if link else page
                assert target.exists(), (page, link)
                assert not part or part in anchors(target), (page, link, part)


@cache
def anchors(page: Path) -> set[str]:
    """Names that links may have for the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


# Extending the suite shows its insides.
SHOWN = [
    *(p for p in PAGES if p.name != "extending.md"),
    *sorted((ROOT / "examples").glob("*.py")),
]


def test_imports_are_from_packages() -> None:
    deeper = r"\b(?:from|import) (?:arm_dynamics|arm_sim|arm_studies)\.\w+\.\S+"
    for page in SHOWN:
        assert re.findall(deeper, page.read_text()) == [], page


def test_figure_of_the_architecture_shows_the_layers_in_force() -> None:
    drawn = runpy.run_path(str(ROOT / "tools/draw_architecture.py"))
    assert drawn["FIGURE"].read_text() == drawn["drawing"]()


def test_scene_of_the_reference_loads() -> None:
    text = re.search(r"```yaml\n(.*?)```", REFERENCE, re.DOTALL)
    assert text
    assert Simulator(yaml.safe_load(text[1])).n == 7


MISTAKES = re.findall(r"^\| `(.+?)` \| `(.+?)` \|$", REFERENCE.split("## Errors")[1], re.MULTILINE)


@pytest.mark.parametrize(("written", "answer"), MISTAKES)
def test_mistakes_get_the_answers_that_the_reference_shows(written: str, answer: str) -> None:
    part = yaml.safe_load(written)
    robot = yaml.safe_load((ROOT / "src/arm_sim/arm_sim/scenes/panda.yaml").read_text())["robot"]
    key = next(iter(part))
    if key == "lock":
        part = {"robot": robot | part}
    elif key == "inertia":
        part = {"payloads": [{"frame": "panda_hand", "mass": 1, **part}]}
    elif key in {"friction", "armature", "actuator", "transmission", "spring"}:
        part = {"joints": {"*" if key == "armature" else "panda_joint1": part}}
    with pytest.raises(ArmError) as error:
        Simulator({"robot": robot} | part, backend="vm")
    assert re.fullmatch(".*".join(map(re.escape, answer.split("…"))), str(error.value))


def test_files_that_pages_and_tools_name_exist() -> None:
    pages = (ROOT / "docs/concepts").glob("equations*.md")
    named = re.findall(r"`(\w+/[\w/]+\.(?:py|c|h))\b", "".join(p.read_text() for p in pages))
    packages = [ROOT / "src" / name / name for name in ("arm_dynamics", "arm_sim")]
    assert named and [x for x in named if sum((p / x).is_file() for p in packages) != 1] == []
    extending = "docs/project/extending.md"
    for file in (".ci/run", "CONTRIBUTING.md", "tools/sanitize.py", extending):
        named = re.findall(r"\btest/[\w/]+\.py", (ROOT / file).read_text())
        assert named and all((ROOT / path).is_file() for path in named), file
    errata = (ROOT / "docs/concepts/errata.md").read_text()
    for shown in re.findall(r"`(test_\w+\.py[\w:]*)`", errata):
        test, _, name = shown.partition("::")
        (found,) = (ROOT / "test").rglob(test)
        assert f"def {name}(" in found.read_text(), shown


COMMANDS = re.compile(r"\./arm ([a-z][a-z-]*)(?: ([\w./:-]+))?|scene:=([\w./:-]+)")
TAKE_A_SCENE = {"sim", "dynamics", "controller", "describe", "build", "export", "urdf", "view"}


def test_commands_exist_and_their_scenes_are_found_from_any_folder() -> None:
    said = COMMANDS.findall("".join(page.read_text() for page in PAGES))
    script = re.findall(r"^    ([a-z-]+)\)$", (ROOT / "arm").read_text(), re.MULTILINE)
    assert {command for command, _, _ in said} - {*script, *suite.commands} <= {""}
    scenes = {scene for _, _, scene in said} | {
        word for command, word, _ in said if command in TAKE_A_SCENE
    }
    named = {scene for scene in scenes if re.fullmatch(r"[a-z0-9_]+", scene)}  # not my_arm.urdf
    assert named <= {*ready_scenes(), "my_scene"}


@pytest.mark.parametrize("name", FACTS)
def test_pages_state_the_figure(name: str) -> None:
    fact = FACTS[name]
    number = fact["value"].split()[0]
    assert len(fact["stated"]) > 1
    for page, words in fact["stated"].items():
        text = " ".join((ROOT / page).read_text().split())
        assert number in words
        assert " ".join(words.split()) in text, page


def test_figures_of_the_readme_are_of_the_file() -> None:
    """Every row of the README's table of measurements that states a figure has a fact."""
    readme = (ROOT / "README.md").read_text()
    table = readme.split("| | measured |\n")[1].split("\n\n")[0]
    stated = [fact["stated"].get("README.md", "") for fact in FACTS.values()]
    rest = table
    for words in filter(None, stated):
        rest = rest.replace(words, "")
    assert re.findall(r"\d+e-\d+|[\d.]+ [µm]s|1/\d+", rest) == ["1 ms"]  # the step itself
