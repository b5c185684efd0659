# SPDX-License-Identifier: Apache-2.0
"""Files that appear together in a folder, or not at all."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from uuid import uuid4

from arm_dynamics import InvalidInput

LIST = "export.json"
"""File that says which files of a folder were exported."""


def check_folder(out: Path) -> None:
    """Refuse a folder whose files were not exported.

    Raises:
        InvalidInput: If it is a file, or contains other files and nothing exported.
    """
    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise InvalidInput(f"'{out}' is not a folder; allowed: a new folder, or an empty one")
    if out.is_dir() and any(out.iterdir()) and not (out / LIST).is_file():
        some = ", ".join(sorted(path.name for path in out.iterdir())[:3])
        raise InvalidInput(
            f"folder '{out}' contains other files ({some}); allowed: a new or empty folder, or "
            "one that was exported before"
        )


def put_files(out: Path, files: Mapping[str, str | bytes]) -> None:
    """Write files into a folder that ``check_folder`` accepts; earlier exported ones go.

    Raises:
        OSError: If they cannot be written; then nothing has changed.
    """
    scratch = out.parent / f".{out.name}-{uuid4().hex}"
    try:
        scratch.mkdir(parents=True)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(out)) from None
    try:
        for name, content in {**files, LIST: json.dumps(sorted(files), indent=1) + "\n"}.items():
            raw = content.encode() if isinstance(content, str) else content
            (scratch / name).write_bytes(raw)
        if not out.exists():
            scratch.rename(out)
        else:
            _replace(out, scratch)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _replace(out: Path, scratch: Path) -> None:
    """Move files into a folder, and remove those of an earlier export."""
    probe, name = tempfile.mkstemp(dir=out)  # fails before anything has changed
    os.close(probe)
    os.unlink(name)
    new = {path.name for path in scratch.iterdir()}
    old = json.loads((out / LIST).read_text(encoding="utf-8")) if (out / LIST).is_file() else []
    for path in scratch.iterdir():
        os.replace(path, out / path.name)
    for name in set(map(str, old)) - new:
        (out / Path(name).name).unlink(missing_ok=True)
