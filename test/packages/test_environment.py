# SPDX-License-Identifier: Apache-2.0
"""What the set-up does to an environment: it gets smaller, and its Python finds everything."""

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from installed import ROOT

PACKAGES = "lib/python3.12/site-packages"
SHOW = "import os, sys; print(os.environ['LD_LIBRARY_PATH'], os.environ['KIND'], sys.argv[1:])"


def test_equal_files_become_one_and_everything_python_needs_stays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    packages = tmp_path / PACKAGES
    robots = packages / "cmeel.prefix/share/example-robot-data/robots"
    content = os.urandom(30_000)
    files = {
        "casadi/libcasadi.so": content, "casadi/libcasadi.so.3": content,
        "casadi/other.so": content[::-1], "casadi/include/a.h": b"x", "casadi/liba.a": b"x",
        "small.py": b"1", "small_too.py": b"1",
    }  # fmt: skip
    for name in ("go1", "panda"):
        files |= {str(robots / f"{name}_description/{f}"): b"x" for f in ("a.stl", "a.urdf")}
    for name, written in files.items():
        (packages / name).parent.mkdir(parents=True, exist_ok=True)
        (packages / name).write_bytes(written)
    runpy.run_path(str(ROOT / "tools/save_space.py"))["main"](tmp_path)
    left = {str(path.relative_to(packages)) for path in packages.rglob("*") if path.is_file()}
    gone = {"casadi/include/a.h", "casadi/liba.a"}
    gone |= {str((robots / "go1_description/a.stl").relative_to(packages))}
    assert left == {str((packages / name).relative_to(packages)) for name in files} - gone
    assert all((packages / name).read_bytes() == files[name] for name in files if name in left)
    one, other = packages / "casadi/libcasadi.so", packages / "casadi/libcasadi.so.3"
    assert one.samefile(other) and one.stat().st_nlink == 2
    assert "0 MB" in capsys.readouterr().out


EXECUTABLES = {
    ("arm_dynamics", "dynamics"), ("arm_dynamics", "controller"), ("arm_sim", "sim"),
    ("arm_sim", "arm"), ("arm_studies", "studies"),
}  # fmt: skip


def test_installed_executables_start() -> None:
    """As ros2 run and ros2 launch start them, by their path; outside the environment, whose
    variables they set themselves.
    """
    found = set((Path(sys.prefix) / "workspace/install/lib").glob("arm_*/*"))
    assert {(path.parent.name, path.name) for path in found} == EXECUTABLES
    plain = {"PATH": "/usr/bin:/bin", "HOME": os.environ.get("HOME", "/")}
    for path in found:
        done = subprocess.run(
            [path, "--help"], env=plain, capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 0 and "usage" in done.stdout.lower(), done.stderr


@pytest.fixture
def environment(tmp_path: Path) -> Path:
    """A virtual environment with what the set-up writes into it."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path], check=True)
    packages = tmp_path / PACKAGES
    (packages / "arm_environment.py").write_bytes((ROOT / "tools/arm_environment.py").read_bytes())
    (packages / "arm.pth").write_text("import arm_environment\n")
    (tmp_path / "environment").write_text("LD_LIBRARY_PATH=/one:/two\nKIND=ours\n")
    return tmp_path


def output_of(environment: Path, *words: str | Path, **given: str) -> str:
    """What its Python prints, started with these variables alone."""
    done = subprocess.run(
        [environment / "bin/python", *words], env={"PATH": "/usr/bin:/bin", **given},
        capture_output=True, text=True, timeout=30, check=True,
    )  # fmt: skip
    assert done.stderr == ""
    return done.stdout


def test_python_gets_what_it_lacks(environment: Path) -> None:
    given = {"LD_LIBRARY_PATH": "/two:/three"}
    assert output_of(environment, "-c", SHOW, "a b", **given) == "/one:/two:/three ours ['a b']\n"
    given = {"LD_LIBRARY_PATH": "/one:/two", "KIND": "theirs"}
    assert output_of(environment, "-c", SHOW, **given) == "/one:/two theirs []\n"


def test_python_starts_once_more_at_most(environment: Path) -> None:
    """Where something takes the folders out again, it must not go round for ever."""
    packages = environment / PACKAGES
    (packages / "taker.py").write_text("import os; os.environ.pop('LD_LIBRARY_PATH', None)\n")
    (packages / "a.pth").write_text("import taker\n")  # read first
    assert output_of(environment, "-c", SHOW) == "/one:/two ours []\n"


@pytest.mark.parametrize(("place", "held"), [("arm_sim/sim", 2), ("mine/sim", 0)])
def test_signals_wait_until_a_node_listens(environment: Path, place: str, held: int) -> None:
    script = environment / place
    script.parent.mkdir()
    script.write_text("import signal; print(len(signal.pthread_sigmask(signal.SIG_BLOCK, [])))\n")
    assert output_of(environment, script) == f"{held}\n"
