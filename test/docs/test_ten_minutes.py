# SPDX-License-Identifier: Apache-2.0
"""The page "Ten minutes", typed from top to bottom as a newcomer does, on a bare machine.

It has an empty home, and no ROS, environment or compiled scene. Except with ``--nightly``,
libraries are linked to those that are here, and a film of five seconds is one of a second. A page
for the browser has to answer only: ``test_page.py`` looks at one. The time of each step is
printed.
"""

import re
import sys
import time
import urllib.request
from itertools import groupby
from pathlib import Path

import page_files
import pages
import pytest
from installed import OFFLINE, copied, link_libraries
from typed import Typed

LIMIT = 600.0  # [s]
ACTIVATE = ". my_env/bin/activate"
OTHERS = re.compile(r"\./arm|pip install \.$")  # begin other pages; instead of another
STEPS = [x for x in pages.steps(pages.ROOT / "docs/start.md") if not OTHERS.match(x.text)]
LONG, SHORT = "sim.run(5.0)", "sim.run(1.0)"


class Newcomer:
    """Types what the page says in the folder of the project, and takes the times."""

    def __init__(self, folder: Path, *, nightly: bool) -> None:
        self.project, home = copied(folder / "project"), folder / "home"
        (home / "bin").mkdir(parents=True)
        (home / "bin/python3.12").symlink_to(Path(sys.base_prefix) / "bin/python3.12")
        page_files.put("my_arm.urdf", self.project, folder)
        self.times: list[tuple[float, str]] = []
        self._nightly = nightly
        self._environment = {
            "HOME": str(home), "PATH": f"{home}/bin:/usr/local/bin:/usr/bin:/bin", "TERM": "xterm",
            "LANG": "C.UTF-8", "TMPDIR": str(folder), **({} if nightly else OFFLINE),
        }  # fmt: skip

    def type(self, line: str) -> str:
        """Type a line, in the environment if it is there; a page in the browser is looked at."""
        begin, goes_on = time.monotonic(), line.startswith("arm view")
        activated = f"{ACTIVATE} && {line}" if (self.project / "my_env").is_dir() else line
        typed = Typed(activated, self.project, self._environment)
        try:
            if goes_on:
                typed.until(lambda: re.search(r"http://\S+\s", typed.said))
                with urllib.request.urlopen(*re.findall(r"http://\S+", typed.said)) as answer:
                    assert answer.status == 200
            else:
                typed.finish()
        finally:
            typed.end()
        if "-m venv" in line and not self._nightly:
            link_libraries(self.project / "my_env")
        self.times.append((time.monotonic() - begin, line))
        return typed.said

    def python(self, blocks: list[str]) -> str:
        """Type blocks of Python one after another."""
        (self.project / "typed.py").write_text("\n".join(blocks))
        return self.type("python typed.py")


@pytest.mark.group("view")
def test_ten_minutes(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    nightly = request.config.getoption("--nightly")
    newcomer = Newcomer(tmp_path, nightly=nightly)
    assert sum(LONG in step.text for step in STEPS) == 1
    printed = ""
    for kind, steps in groupby(STEPS, lambda step: step.kind):
        texts = [x.text if nightly else x.text.replace(LONG, SHORT) for x in steps]
        if kind == "python":
            printed += newcomer.python(texts)
        else:
            printed += "".join(map(newcomer.type, texts))
    total = sum(seconds for seconds, _ in newcomer.times)
    rows = (f"{seconds:6.1f} s  {line}" for seconds, line in newcomer.times)
    print(*rows, f"{total:6.1f} s in all; pictures: {newcomer.project}", sep="\n")
    assert total < LIMIT
    assert "WARNING" not in printed and re.search(r"22\.17|2\.217\d*e\+01", printed)
    made = [newcomer.project / name for name in ("falling.png", "pendulum.gif", "slide.gif")]
    assert min(path.stat().st_size for path in made) > 1000
    (one_line,) = re.findall(r"`(python -c [^`]+)`", (pages.ROOT / "README.md").read_text())
    made[0].unlink()
    newcomer.type(one_line)
    assert made[0].stat().st_size > 1000
