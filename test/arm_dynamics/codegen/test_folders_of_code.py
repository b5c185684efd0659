# SPDX-License-Identifier: Apache-2.0
"""Code is taken only from folders and files that no other user can have written."""

import os
import stat
from pathlib import Path
from types import SimpleNamespace

import pytest

from arm_dynamics import KernelError
from arm_dynamics.codegen.compiled_scenes import make_folder

US = 1000


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Of a user who is not root, whoever runs the tests."""
    monkeypatch.setattr(os, "getuid", lambda: US)
    return tmp_path


@pytest.mark.parametrize(
    ("kind", "mode", "owner", "said"),
    [
        (stat.S_IFDIR, 0o755, 0, ""),
        (stat.S_IFDIR, 0o700, US, ""),
        (stat.S_IFDIR, 0o755, 1, "belongs to user 1, neither to root nor to this one"),
        (stat.S_IFDIR, 0o755, US + 1, f"belongs to user {US + 1}"),
        (stat.S_IFDIR, 0o720, 0, r"can be written by others \(mode 720\)"),
        (stat.S_IFDIR, 0o702, US, r"can be written by others \(mode 702\)"),
        (stat.S_IFLNK, 0o755, US, "is not a plain file$"),
        (stat.S_IFIFO, 0o755, US, "is not a plain file$"),
    ],
)
def test_only_what_is_roots_or_ones_own_is_taken(
    folder: Path, monkeypatch: pytest.MonkeyPatch, kind: int, mode: int, owner: int, said: str
) -> None:
    """Whatever the system reports of every file."""
    reported = SimpleNamespace(st_mode=kind | mode, st_uid=owner)
    monkeypatch.setattr(Path, "lstat", lambda _: reported)
    if said:
        with pytest.raises(KernelError, match=said):
            make_folder(folder)
    else:
        make_folder(folder)


def test_a_new_folder_is_made_for_its_owner_alone(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        make_folder(tmp_path / "a/b")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a/b").stat().st_mode) == 0o755
    make_folder(tmp_path / "a/b")
