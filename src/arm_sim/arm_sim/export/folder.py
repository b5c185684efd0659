# SPDX-License-Identifier: Apache-2.0
"""The folder of an export, in which a new export replaces an earlier one."""

import json
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from uuid import uuid4

from arm_dynamics import InvalidInput

# File that says which files of a folder were exported
MANIFEST = "export.json"


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
        InvalidInput: If a folder, or a file that was not exported, has the name of a file; then
            nothing has changed.
        OSError: If they cannot be written; then nothing has changed, unless moving them into an
            earlier export failed midway, whose manifest then names old and new files.
    """
    old = _exported(out)
    for name in (*files, MANIFEST, *old):
        if (out / name).is_dir():
            raise InvalidInput(f"'{out / name}' is a folder; allowed: a file, which is replaced")
        if name not in (MANIFEST, *old) and (out / name).exists():
            raise InvalidInput(f"'{out / name}' was not exported; allowed: another folder or name")
    scratch = out.parent / f".{out.name}-{uuid4().hex}"
    try:
        scratch.mkdir(parents=True)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(out)) from None
    try:
        for name, content in files.items():
            raw = content.encode() if isinstance(content, str) else content
            (scratch / name).write_bytes(raw)
        manifest = scratch / MANIFEST
        manifest.write_text(json.dumps(sorted({*files, *old}), indent=1) + "\n")
        if not out.exists():
            scratch.rename(out)
            return
        tempfile.TemporaryFile(dir=out).close()  # fails before anything has changed
        manifest.replace(out / MANIFEST)
        for name in files:
            (scratch / name).replace(out / name)
        for name in {*old} - {*files, MANIFEST}:
            (out / name).unlink(missing_ok=True)
        manifest.write_text(json.dumps(sorted(files), indent=1) + "\n")
        manifest.replace(out / MANIFEST)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _exported(out: Path) -> list[str]:
    """Names of the files of an earlier export."""
    manifest = out / MANIFEST
    try:
        names = json.loads(manifest.read_bytes())
    except (FileNotFoundError, NotADirectoryError):
        return []
    except ValueError:
        names = None
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InvalidInput(
            f"'{manifest}' is damaged; allowed: a list of exported files, or another folder"
        )
    return [Path(name).name for name in names]
