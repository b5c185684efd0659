# SPDX-License-Identifier: Apache-2.0
"""The lines of the pages that install something, typed as they stand.

Usually what is here stands in for the network; with ``--nightly`` pip and git load everything.
"""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pages
import pytest
from installed import KEPT, copied

BY_PIP = re.compile(
    r"python3\.12 -m venv my_env|\. my_env/bin/activate|pip install (?!--target).*|jupyter lab|"
    r"python tools/save_space\.py my_env"
)
INTO_VENV = re.compile(r"git clone .*|\.venv/bin/.*")
GOES_ON = {"jupyter lab": "is running at"}  # until Ctrl-C, and what it says


def lines(kind: re.Pattern[str]) -> list[str]:
    """What a reader types, each line once; first the environment, then that page about it."""
    page = pages.ROOT / "docs/how-to/install.md"
    steps = [s for p in (page, *pages.PAGES) for s in pages.steps(p) if s.kind == "line"]
    found = dict.fromkeys(s.text for s in steps if kind.fullmatch(s.text))
    return sorted(found, key=lambda line: "my_env" not in line or "save_space" in line)


def typed(all_lines: list[str], folder: Path, **more: str) -> str:
    """Type lines into one shell; what it and they say."""
    script = ""
    for line in all_lines:
        stop = f"timeout 60 {line} || [ $? = 124 ]" if line in GOES_ON else line
        script += f"printf '$ %s\\n' {shlex.quote(line)}\n{stop}\n"
    given = {name: os.environ[name] for name in KEPT if name in os.environ}
    given["PATH"] = f"{folder / 'bin'}:/usr/local/bin:/usr/bin:/bin"
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", script], cwd=folder, env=given | more,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:]
    return done.stdout


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A copy of the project, and a Python that a reader finds."""
    shutil.copytree(pages.ROOT / "tools", copied(tmp_path) / "tools")
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin/python3.12").symlink_to(Path(sys.base_prefix) / "bin/python3.12")
    return tmp_path


def test_extras_are_on_the_page_that_lists_them_and_those_that_pages_name_exist() -> None:
    text = (pages.ROOT / "docs/how-to/install.md").read_text()
    listed = re.findall(r"`([\w-]+)`", " ".join(re.findall(r"^\| (`[^|]+) \|", text, re.M)))
    project = tomllib.loads((pages.ROOT / "pyproject.toml").read_text())["project"]
    there = project["optional-dependencies"].keys()
    assert there <= set(listed)
    named = set(re.findall(r'"\.\[([\w-]+)\]"', " ".join(lines(BY_PIP))))
    assert {"jax", "notebook", "teaching", "view"} <= named <= there


@pytest.mark.nightly
def test_everything_that_pip_installs(project: Path) -> None:
    """From its registry; with the gallery, whose pages then run."""
    settings = {"ServerApp": {"allow_root": True, "open_browser": False}}
    (project / "settings/jupyter_server_config.json").parent.mkdir()
    (project / "settings/jupyter_server_config.json").write_text(json.dumps(settings))
    shutil.copytree(pages.ROOT / "docs/gallery", project / "docs/gallery")
    run = [f"python {page}" for page in sorted((project / "docs/gallery").glob("*/plot_*.py"))]
    assert 'pip install ".[gallery]"' in (project / "docs/gallery/README.rst").read_text()
    gallery = ['pip install ".[gallery]"', *run]
    more = {"MPLBACKEND": "Agg", "JUPYTER_CONFIG_DIR": str(project / "settings")}
    said = typed([*lines(BY_PIP), "arm describe panda", *gallery], project, **more)
    assert "WARNING: arm" not in said
    assert all(words in said for words in GOES_ON.values())


@pytest.mark.nightly
def test_everything_that_is_installed_into_the_environment_of_arm(project: Path) -> None:
    """From GitHub and the registry; the environment is one that sees this one."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", project / ".venv"], check=True)
    packages = project / ".venv/lib/python3.12/site-packages"
    (packages / "here.pth").write_text("\n".join(p for p in sys.path if p.endswith("-packages")))
    kept = re.compile("GIT_CONFIG.*|LD_LIBRARY_PATH|AMENT_PREFIX_PATH|_ROS_WHEELS.*|RMW_.*")
    more = {name: value for name, value in os.environ.items() if kept.fullmatch(name)}
    said = typed(lines(INTO_VENV), project, **more)
    assert "/rosout" in said.rpartition("$ .venv/bin/ros2 topic list")[2]
