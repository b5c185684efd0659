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


def found(monkeypatch: pytest.MonkeyPatch, mode: int, owner: int) -> None:
    """Let the system report this for every file."""
    said = SimpleNamespace(st_mode=mode, st_uid=owner)
    monkeypatch.setattr(Path, "lstat", lambda _: said)


@pytest.mark.parametrize("owner", [0, US])
@pytest.mark.parametrize("mode", [0o755, 0o700, 0o555])
def test_what_is_roots_or_ones_own_is_taken(
    folder: Path, monkeypatch: pytest.MonkeyPatch, owner: int, mode: int
) -> None:
    found(monkeypatch, stat.S_IFDIR | mode, owner)
    make_folder(folder)


@pytest.mark.parametrize("owner", [1, US - 1, US + 1])
def test_what_is_another_users_is_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch, owner: int
) -> None:
    found(monkeypatch, stat.S_IFDIR | 0o755, owner)
    said = rf"belongs to user {owner}, neither to root nor to this one \({US}\)$"
    with pytest.raises(KernelError, match=said):
        make_folder(folder)


@pytest.mark.parametrize("mode", [0o775, 0o757, 0o777, 0o720, 0o702])
@pytest.mark.parametrize("owner", [0, US])
def test_what_others_may_write_is_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch, owner: int, mode: int
) -> None:
    found(monkeypatch, stat.S_IFDIR | mode, owner)
    with pytest.raises(KernelError, match=rf"can be written by others \(mode {mode:o}\)"):
        make_folder(folder)


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFSOCK, stat.S_IFCHR])
def test_what_is_neither_file_nor_folder_is_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch, kind: int
) -> None:
    found(monkeypatch, kind | 0o755, US)
    with pytest.raises(KernelError, match="is not a plain file$"):
        make_folder(folder)


def test_a_new_folder_is_made_for_its_owner_alone(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        make_folder(tmp_path / "a/b")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a/b").stat().st_mode) == 0o755
    make_folder(tmp_path / "a/b")
