# SPDX-License-Identifier: Apache-2.0
"""Builds what a release consists of, checks it, and prints how it would be published.

    ./arm python tools/release.py --out dist

Makes the source distribution and the wheel of ``arm-dynamics-suite``, which holds the three
libraries, from what is committed, and checks their metadata by twine. It publishes nothing: the
last lines it prints do. It needs the packages ``build`` and ``twine``.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tarfile
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]


def version() -> str:
    """The version of the suite, which has a section of its own in the changelog.

    Raises:
        SystemExit: If something is not committed, or the changelog does not have the version.
    """
    if git("status", "--porcelain"):
        sys.exit("release: there are changes that are not committed; a clean tree is expected")
    text = git("show", "HEAD:src/arm_dynamics/arm_dynamics/__init__.py").decode()
    (found,) = re.findall(r'^__version__ = "(.*)"$', text, re.MULTILINE)
    if f"## [{found}]" not in git("show", "HEAD:CHANGELOG.md").decode():
        sys.exit(f"release: CHANGELOG.md has no section [{found}]; rename [Unreleased]")
    return str(found)


def git(*words: str) -> bytes:
    """What git says."""
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True).stdout


def build(out: Path) -> list[Path]:
    """Source distribution and wheel of what is committed, checked by twine."""
    python = [sys.executable, "-m"]
    with TemporaryDirectory() as folder:
        with tarfile.open(fileobj=BytesIO(git("archive", "HEAD"))) as committed:
            committed.extractall(folder, filter="data")
        subprocess.run([*python, "build", "--outdir", str(out.resolve())], cwd=folder, check=True)
    made = sorted(out.glob("*"))
    subprocess.run([*python, "twine", "check", "--strict", *map(str, made)], check=True)
    return made


def main() -> None:
    """Build, check, and say how to publish."""
    about = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    about.add_argument("--out", type=Path, default=Path("dist"), help="empty or new folder")
    about.add_argument("--trial", action="store_true", help="whatever the changelog says")
    given = about.parse_args()
    missing = [name for name in ("build", "twine") if not find_spec(name)]
    if missing:
        sys.exit(f"release: packages {', '.join(missing)} are missing; pip install build twine")
    given.out.mkdir(parents=True, exist_ok=True)
    if any(given.out.iterdir()):
        sys.exit(f"release: '{given.out}' is not empty; an empty or new folder is expected")
    tag = "v…" if given.trial else f"v{version()}"
    made = build(given.out)
    print("\n".join(f"{path.stat().st_size / 1e6:6.2f} MB  {path.name}" for path in made))
    print(f"nothing is published; to publish:\n  git tag {tag} && git push origin {tag}")
    print(f"  {sys.executable} -m twine upload {given.out}/*")


if __name__ == "__main__":
    main()
