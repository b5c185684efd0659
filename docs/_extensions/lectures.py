# SPDX-License-Identifier: Apache-2.0
"""The gallery by lecture, from what the scripts say of themselves at the end of their headers.

``:Lectures:`` names courses and their topics, as in the notes; ``:Equations:`` sections of
:file:`concepts` by number, or sections of the page of drives by name; ``:Shows:`` says what is to
be seen. Entries are separated by semicolons.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
COURSES = ("EECS 106B", "HCMUTE", "CTU", "session 17", "ME 6102", "textbooks")
FIELD = re.compile(r"^:(Lectures|Equations|Shows): (.*(?:\n +.*)*)$", re.MULTILINE)
NUMBERED = "equations.md", "equations-of-simulation.md"
NAMED = "drives.md"


@dataclass(frozen=True)
class Page:
    """A page of the gallery.

    Attributes:
        link: Where it is in the site.
        title: Its title.
        lectures: Course and topic of each lecture that has its system.
        equations: Numbers or names of sections.
        shows: What is to be seen.
    """

    link: str
    title: str
    lectures: tuple[tuple[str, str], ...]
    equations: tuple[str, ...]
    shows: str


def pages() -> list[Page]:
    """All pages of the gallery, mechanics first."""
    folders = [DOCS / "gallery" / name for name in ("mechanics", "drives", "control")]
    return [read(file) for folder in folders for file in sorted(folder.glob("plot_*.py"))]


def read(file: Path) -> Page:
    """What a script says of itself.

    Raises:
        ValueError: If a field is missing, or names an unknown course or section.
    """
    text = ast.get_docstring(ast.parse(file.read_text())) or ""
    said = {name: " ".join(value.split()) for name, value in FIELD.findall(text)}
    if set(said) != {"Lectures", "Equations", "Shows"}:
        raise ValueError(f"{file}: fields {sorted(said)}; expected Lectures, Equations, Shows")
    lectures = [lecture.partition(", ")[::2] for lecture in said["Lectures"].split("; ")]
    equations = said["Equations"].split("; ")
    unknown = [course for course, _ in lectures if course not in COURSES]
    unknown += [section for section in equations if section not in sections()]
    if unknown:
        raise ValueError(f"{file}: unknown {unknown}; allowed: {COURSES}, {sorted(sections())}")
    link = f"/generated/gallery/{file.parent.name}/{file.stem}.rst"
    return Page(link, text.split("\n")[0], tuple(lectures), tuple(equations), said["Shows"])


def sections() -> dict[str, str]:
    """Links to sections of the concepts by number, and of the page of drives by name."""
    found = {}
    for page in (*NUMBERED, NAMED):
        for heading in re.findall(r"^## (.*)$", (DOCS / "concepts" / page).read_text(), re.M):
            anchor = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
            key = heading if page == NAMED else heading.split()[0]
            found[key] = f"{page}#{anchor}"
    return found


def titles() -> dict[str, str]:
    """The courses by their short names, titled as on the page of their errata."""
    found = re.findall(r"^## (.*)$", (DOCS / "concepts/errata.md").read_text(), re.M)
    named = {key: title for key in COURSES for title in found if key in title}
    return named | {"textbooks": "Textbooks"}


def markdown() -> str:
    """A table for each course: topic, page of the gallery, what it shows, equations."""
    every, where = pages(), sections()
    blocks = []
    for course in COURSES:
        rows = [
            f"| {topic} | [{page.title}]({page.link}) | {page.shows} | "
            f"{', '.join(f'[{section}]({where[section]})' for section in page.equations)} |"
            for page in every
            for key, topic in page.lectures
            if key == course
        ]
        head = ["| in the notes | in the gallery | shows | equations |", "|---|---|---|---|"]
        blocks.append("\n".join([f"## {titles()[course]}", "", *head, *rows, ""]))
    return "\n".join(blocks)
