# SPDX-License-Identifier: Apache-2.0
"""The folder of an export, in which a new export replaces an earlier one."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from uuid import uuid4

from arm_dynamics import InvalidInput

MANIFEST = "export.json"
"""File that says which files of a folder were exported."""


def check_folder(out: Path) -> None:
    """Refuse a folder whose files were not exported.

    Raises:
        InvalidInput: If it is a file, or contains other files and nothing exported, or its
            manifest is damaged.
    """
    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise InvalidInput(f"'{out}' is not a folder; allowed: a new folder, or an empty one")
    if out.is_dir() and any(out.iterdir()) and not (out / MANIFEST).is_file():
        some = ", ".join(sorted(path.name for path in out.iterdir())[:3])
        raise InvalidInput(
            f"folder '{out}' contains other files ({some}); allowed: a new or empty folder, or "
            "one that was exported before"
        )
    _exported(out)


def write_folder(out: Path, files: Mapping[str, str | bytes]) -> None:
    """Write files into a folder that ``check_folder`` accepts; earlier exported ones go.

    Raises:
        InvalidInput: If a folder has the name of a file; then nothing has changed.
        OSError: If they cannot be written; then nothing has changed, unless moving them into an
            earlier export failed midway, which still has its manifest.
    """
    old = _exported(out)
    for name in (*files, MANIFEST, *old):
        if (out / name).is_dir():
            raise InvalidInput(f"'{out / name}' is a folder; allowed: a file, which is replaced")
    scratch = out.parent / f".{out.name}-{uuid4().hex}"
    try:
        scratch.mkdir(parents=True)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(out)) from None
    try:
        manifest = json.dumps(sorted(files), indent=1) + "\n"
        for name, content in {**files, MANIFEST: manifest}.items():
            raw = content.encode() if isinstance(content, str) else content
            (scratch / name).write_bytes(raw)
        if not out.exists():
            scratch.rename(out)
            return
        tempfile.TemporaryFile(dir=out).close()  # fails before anything has changed
        for name in {*old} - {*files, MANIFEST}:
            (out / name).unlink(missing_ok=True)
        for name in (*files, MANIFEST):
            (scratch / name).replace(out / name)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _exported(out: Path) -> list[str]:
    """Names of the files of an earlier export."""
    manifest = out / MANIFEST
    try:
        return [Path(name).name for name in json.loads(manifest.read_bytes())]
    except (FileNotFoundError, NotADirectoryError):
        return []
    except (TypeError, ValueError):
        raise InvalidInput(
            f"'{manifest}' is damaged; allowed: a list of exported files, or another folder"
        ) from None
