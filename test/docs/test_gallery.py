# SPDX-License-Identifier: Apache-2.0
"""Every page of the gallery runs, and draws what it promises; what it claims it asserts itself."""

import runpy
from collections.abc import Iterator
from pathlib import Path

import pytest
from matplotlib import pyplot as plt
from matplotlib.animation import FuncAnimation
from pictures import unseen

from arm_dynamics.scene import ready_scenes
from docs._extensions import lectures

GALLERY = Path(__file__).parents[2] / "docs/gallery"
PAGES = sorted(GALLERY.glob("*/plot_*.py"))


@pytest.fixture
def paper(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Figures without a window, and an empty working folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plt, "show", lambda: None)  # with a display, Agg warns
    with unseen():
        yield


@pytest.mark.parametrize("page", PAGES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_page_runs(page: Path, paper: None, tmp_path: Path) -> None:
    made = runpy.run_path(str(page), run_name="__main__")
    assert sum(isinstance(value, FuncAnimation) for value in made.values()) == 1
    assert len(plt.get_fignums()) >= 2  # the animation is one
    for number in plt.get_fignums():
        plt.figure(number).canvas.draw()
    assert list(tmp_path.iterdir()) == []


def test_every_scene_of_the_lectures_is_on_a_page() -> None:
    folder = GALLERY.parents[1] / "src/arm_sim/arm_sim/scenes/lectures"
    names = {path.stem for path in folder.glob("*.yaml")}
    text = "".join(page.read_text() for page in PAGES)
    assert {name for name in names if f'"{name}"' not in text} == set()
    assert names <= set(ready_scenes())


def test_every_page_says_which_lectures_and_equations_it_is_about() -> None:
    found = lectures.pages()
    assert len(found) == len(PAGES)
    assert {course for page in found for course, _ in page.lectures} == set(lectures.COURSES)
    first_page = (GALLERY / "README.rst").read_text()
    assert all(f"`{page.title} <" in first_page and page.shows in first_page for page in found)


def test_a_lecture_or_section_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    text, page = (GALLERY / "mechanics/plot_table.py").read_text(), tmp_path / "plot_table.py"
    for field, wrong in (("Lectures: CTU", "Lectures: MIT"), ("Equations: 19", "Equations: 99")):
        page.write_text(text.replace(field, wrong, 1))
        with pytest.raises(ValueError, match=r"unknown \['(MIT|99)'\]"):
            lectures.read(page)
