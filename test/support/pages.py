# SPDX-License-Identifier: Apache-2.0
"""Pages of the documentation as steps: files that they show, Python, and lines for a shell."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted(
        page
        for page in (ROOT / "docs").rglob("*.md")
        if not {"generated", "project"} & set(page.relative_to(ROOT).parts)
    ),
]
FILE = re.compile(r"(?:#|//|<!--) ([\w-]+\.(?:yaml|urdf|xml|py|cpp|txt))(?: -->)?\n")
_PARTS = re.compile(
    r"(?P<skip><!-- not run: [^>]+ -->\n+)?^```(?P<kind>\w+)[^\n]*\n(?P<text>.*?)^```"
    r"(?:\n+^```text\n(?P<printed>.*?)^```)?"
    r"|^```.*?^```|^ {4}(?P<indented>(?:\./arm|ros2) .*?)$"
    r"|(?<!`)`(?P<inline>(?:(?:\./)?arm|ros2|pip install|python tools/\S+|\.venv/bin/\w+)"
    r"\s[^`]+)`",
    re.M | re.S,
)
SHELL = ("bash", "console")
_OPEN_WORDS = re.compile(r"…|(?<![\w.])\[|\b[A-Z]{3,}\b")  # a form, no command


class Step(NamedTuple):
    """One thing that a page does."""

    kind: str  # ``file``, ``python`` or ``line``
    text: str  # text of the file, Python, or what is typed
    name: str = ""  # of the file
    # What the page shows as the answer to a line, or in a block ``text`` after Python as what that
    # prints; None if it shows nothing
    shown: str | None = None


def label(page: Path) -> str:
    """The page as tests call it, such as ``how-to/view``."""
    return page.stem if page.parent == ROOT else f"{page.parent.name}/{page.stem}"


def steps(page: Path) -> Iterator[Step]:
    """What a page does, from top to bottom.

    In running text and tables, a command with at least one argument is a line; one that shows a
    form (``…``, ``SCENE``, ``[TOPIC]``) or only names a command or an option is none.
    """
    for part in _PARTS.finditer(page.read_text()):
        if part["indented"]:
            yield Step("line", _bare(part["indented"]))
        elif part["inline"]:
            yield from _inline(" ".join(part["inline"].split()))
        elif part["kind"] in SHELL or (part["kind"] and not part["skip"]):
            yield from _block(part["kind"], part["text"], part["printed"])


def _inline(words: str) -> Iterator[Step]:
    *most, last = words.split()
    if len(most) > 1 and not last.startswith("-") and not _OPEN_WORDS.search(words):
        yield Step("line", words)


def _block(kind: str, text: str, printed: str | None) -> Iterator[Step]:
    if (named := FILE.match(text)) and kind != "bash":
        yield Step("file", text, named[1])
    elif kind == "python":
        yield Step("python", text, shown=printed)
    elif kind == "console":
        for typed in re.split(r"^\$ ", text, flags=re.M)[1:]:
            line, _, shown = typed.partition("\n")
            yield Step("line", _bare(line), shown=shown or None)
    elif kind == "bash":
        for line in _whole_lines(text):
            yield Step("line", _bare(line))


def _whole_lines(text: str) -> Iterator[str]:
    """Lines as the shell reads them: over ends that are escaped or inside quotation marks."""
    line = ""
    for part in text.splitlines():
        line = f"{line}\n{part}" if line else part
        if line.endswith("\\") or line.replace('\\"', "").count('"') % 2:
            continue
        if line.strip():
            yield line
        line = ""
    assert not line, f"a quotation mark is not closed: {line}"


def _bare(line: str) -> str:
    """Without the comment and the sign that a command goes on in the background."""
    return re.sub(r"\s+(#\s.*|&)$", "", line)
