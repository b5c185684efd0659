# SPDX-License-Identifier: Apache-2.0
"""The cache of compiled code: private, checked, and not needed to be right; no compiler is no
error.
"""

import logging
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from arm_dynamics import KernelError
from arm_dynamics.codegen import Kernel, compiler, user_cache

HERE = str(Path(__file__).parent)
IMPORT = f"import sys; sys.path.insert(0, {HERE!r}); import test_compiler as t; "


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of this test's own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return user_cache.folder()


def triple(factor: float = 3.0) -> Kernel:
    x = ca.SX.sym("x")
    return Kernel([ca.Function("triple", [x], [factor * x])], backend="native")


def value(kernel: Kernel) -> float:
    return float(kernel.call("triple")(np.array([2.0]))[0][0])


def entries(cache: Path) -> list[Path]:
    return sorted(cache.glob("*.so"))


def test_folder_is_the_users_own(cache: Path, tmp_path: Path) -> None:
    assert cache.is_relative_to(tmp_path)
    assert cache.stat().st_mode & 0o777 == 0o700


def test_folder_that_cannot_be_used_is_named_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert user_cache.folder() == user_cache.folder()
    assert caplog.text.count("cannot be used: compiled code is kept for this process only") == 1


def test_second_build_takes_the_entry(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    triple()
    before = [(path, path.stat().st_mtime_ns) for path in entries(cache)]

    def run(*args: object, **kwargs: object) -> None:
        raise AssertionError("the compiler was called")

    monkeypatch.setattr(subprocess, "Popen", run)
    assert value(triple()) == 6.0
    assert [(path, path.stat().st_mtime_ns) for path in entries(cache)] == before


def test_other_code_is_another_entry(cache: Path) -> None:
    assert (value(triple(3.0)), value(triple(4.0))) == (6.0, 8.0)
    assert len(entries(cache)) == 2


@pytest.mark.parametrize("header", ["scalar.h", "sincos.h"])
def test_another_header_is_another_entry(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, header: str
) -> None:
    """A change of a header only, included directly or by another one, is noticed."""
    native = tmp_path / "native"
    shutil.copytree(compiler.NATIVE, native)
    monkeypatch.setattr(compiler, "NATIVE", native)
    triple()
    assert len(entries(cache)) == 1
    with (native / header).open("a") as file:
        file.write("#define SOMETHING_NEW\n")
    triple()
    assert len(entries(cache)) == 2


@pytest.mark.parametrize("damage", ["cut", "flipped", "emptied", "replaced"])
def test_damaged_entry_is_built_again(cache: Path, damage: str) -> None:
    triple()
    (entry,) = entries(cache)
    good = entry.read_bytes()
    flipped = bytearray(good)
    flipped[len(flipped) // 2] ^= 0xFF
    changed = {
        "cut": good[:-100], "flipped": bytes(flipped), "emptied": b"",
        "replaced": b"\x7fELF rubbish",
    }  # fmt: skip
    entry.unlink()
    entry.write_bytes(changed[damage])
    assert value(triple()) == 6.0
    assert entry.read_bytes() != changed[damage]
    assert len(entry.read_bytes()) == len(good)


def test_a_link_in_the_cache_is_not_followed(cache: Path, tmp_path: Path) -> None:
    triple()
    (entry,) = entries(cache)
    elsewhere = tmp_path / "elsewhere.so"
    shutil.move(entry, elsewhere)
    entry.symlink_to(elsewhere)
    assert value(triple()) == 6.0
    assert not entry.is_symlink()


def test_folder_open_to_others_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "arm_dynamics").mkdir()
    (tmp_path / "arm_dynamics").chmod(0o777)
    assert value(triple()) == 6.0
    assert entries(tmp_path / "arm_dynamics") == []


def test_without_a_compiler(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """auto falls back with a warning, native is an error, vm needs none."""
    monkeypatch.setenv("CC", "/no/such/compiler")
    x = ca.SX.sym("x")
    function = ca.Function("triple", [x], [3 * x])
    with caplog.at_level(logging.WARNING):
        kernel = Kernel([function])
    assert not kernel.native and value(kernel) == 6.0
    assert "compiler" in caplog.text
    assert value(Kernel([function], backend="vm")) == 6.0
    with pytest.raises(KernelError, match="compiler"):
        Kernel([function], backend="native")


def test_compiler_that_fails(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Code that cannot be compiled raises the compiler's message and leaves no entry."""
    with pytest.raises(KernelError, match="nonsense"):
        compiler.build("this is nonsense;")
    assert list(cache.iterdir()) == []


def test_a_compiler_that_was_ended_is_named_with_the_signal() -> None:
    with pytest.raises(KernelError, match="^sh was ended by SIGKILL before it had compiled"):
        compiler._run(["true"], ["sh", "-c", "kill -KILL $$"])


def test_an_interruption_ends_all_compilers(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[subprocess.Popen[str]] = []
    start = subprocess.Popen

    def interrupted(command: list[str], **options: object) -> subprocess.Popen[str]:
        if len(started) == 1:
            monkeypatch.setattr(started[0], "communicate", interrupt)
        started.append(start(command, **options))
        return started[-1]

    def interrupt() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(subprocess, "Popen", interrupted)
    with pytest.raises(KeyboardInterrupt):
        compiler._run(["sleep", "600"], ["sleep", "600"])
    assert [process.returncode for process in started] == [-signal.SIGTERM] * 2


def test_many_processes_at_once(cache: Path) -> None:
    """All build the same entry in an empty cache; each gets an intact one."""
    command = [sys.executable, "-c", IMPORT + "print(t.value(t.triple()))"]
    running = [
        subprocess.Popen(command, stdout=subprocess.PIPE, env=os.environ.copy()) for _ in range(3)
    ]
    assert [process.communicate(timeout=120)[0] for process in running] == [b"6.0\n"] * 3
    assert len(entries(cache)) == 1
