# SPDX-License-Identifier: Apache-2.0
"""The cache of compiled code: private, checked, and not needed to be right; no compiler is no
error.
"""

import logging
import os
import shutil
import signal
import stat
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from arm_dynamics import KernelError
from arm_dynamics.codegen import Kernel, compiler, user_cache
from arm_dynamics.codegen.compiled_scenes import make_folder


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


def test_folder_that_cannot_be_used_is_named_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert user_cache.folder() == user_cache.folder()
    assert caplog.text.count("cannot be used: compiled code is kept for this process only") == 1


def test_other_code_and_another_header_are_other_entries(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also a header that another one includes; in a folder of the user alone."""
    assert cache.is_relative_to(tmp_path) and cache.stat().st_mode & 0o777 == 0o700
    native = tmp_path / "native"
    shutil.copytree(compiler.NATIVE, native)
    monkeypatch.setattr(compiler, "NATIVE", native)
    assert (value(triple(3.0)), value(triple(4.0))) == (6.0, 8.0)
    assert len(entries(cache)) == 2
    with (native / "sincos.h").open("a") as file:
        file.write("#define SOMETHING_NEW\n")
    triple()
    assert len(entries(cache)) == 3


def test_damaged_entry_is_built_again_and_a_good_one_is_not(cache: Path) -> None:
    triple()
    (entry,) = entries(cache)
    good, when = entry.read_bytes(), entry.stat().st_mtime_ns
    flipped = bytearray(good)
    flipped[len(flipped) // 2] ^= 0xFF
    assert value(triple()) == 6.0 and entry.stat().st_mtime_ns == when
    for changed in (good[:-100], bytes(flipped), b""):
        entry.unlink()
        entry.write_bytes(changed)
        assert value(triple()) == 6.0
        assert entry.read_bytes() != changed and len(entry.read_bytes()) == len(good)


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
    code = "import test_compiler as t; print(t.value(t.triple()))"
    command, here = [sys.executable, "-c", code], Path(__file__).parent
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, cwd=here) for _ in range(3)]
    assert [process.communicate(timeout=120)[0] for process in running] == [b"6.0\n"] * 3
    assert len(entries(cache)) == 1


def outer(backend: str = "native") -> Kernel:
    """x xᵀ and the sum of x for two numbers."""
    x = ca.SX.sym("x", 2)
    return Kernel([ca.Function("outer", [x], [x @ x.T, ca.sum1(x)])], backend)


def test_a_kernel_is_recalled_without_its_expressions(cache: Path) -> None:
    outer("vm").keep("outer of two")
    assert Kernel.recall("outer of two") is None
    made = outer()
    made.keep("outer of two")
    assert Kernel.recall("outer of three") is None
    found = Kernel.recall("outer of two")
    assert found is not None and found.native
    assert found.backend == made.backend
    assert found.operations("outer") == made.operations("outer")
    product, total = found.call("outer")(np.array([2.0, 3.0]))
    np.testing.assert_array_equal(product, [[4.0, 6.0], [6.0, 9.0]])
    assert total == 5.0


def test_what_is_gone_or_damaged_is_built_again(cache: Path) -> None:
    for suffix, damage in (
        ("json", lambda path: path.write_bytes(b"x" * 100)),
        ("so", Path.unlink),
    ):
        outer().keep("outer of two")
        assert Kernel.recall("outer of two") is not None
        for path in cache.glob(f"*.{suffix}"):
            damage(path)
        assert Kernel.recall("outer of two") is None


US = 1000  # a user who is not root, whoever runs the tests


@pytest.mark.parametrize(
    ("kind", "mode", "owner", "said"),
    [
        (stat.S_IFDIR, 0o755, 0, ""),
        (stat.S_IFDIR, 0o700, US, ""),
        (stat.S_IFDIR, 0o755, 1, "belongs to user 1, neither to root nor to this one"),
        (stat.S_IFDIR, 0o720, 0, r"can be written by others \(mode 720\)"),
        (stat.S_IFDIR, 0o702, US, r"can be written by others \(mode 702\)"),
        (stat.S_IFLNK, 0o755, US, "is not a plain file$"),
    ],
)
def test_only_what_is_roots_or_ones_own_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: int, mode: int, owner: int, said: str
) -> None:
    """Whatever the system reports of every file."""
    reported = SimpleNamespace(st_mode=kind | mode, st_uid=owner)
    monkeypatch.setattr(os, "getuid", lambda: US)
    monkeypatch.setattr(Path, "lstat", lambda _: reported)
    with pytest.raises(KernelError, match=said) if said else nullcontext():
        make_folder(tmp_path)


def test_a_new_folder_is_made_for_its_owner_alone(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        make_folder(tmp_path / "a/b")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a/b").stat().st_mode) == 0o755
    make_folder(tmp_path / "a/b")
