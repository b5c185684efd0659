# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels found by the inputs they were generated from."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from arm_dynamics.codegen import Kernel, user_cache


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of this test's own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return user_cache.folder()


def outer(backend: str = "native") -> Kernel:
    """x xᵀ and the sum of x for two numbers."""
    x = ca.SX.sym("x", 2)
    return Kernel([ca.Function("outer", [x], [x @ x.T, ca.sum1(x)])], backend)


def test_a_kernel_is_recalled_without_its_expressions(cache: Path) -> None:
    made = outer()
    made.keep("outer of two")
    found = Kernel.recalled("outer of two")
    assert found is not None
    assert found.native
    assert found.backend == made.backend
    assert found.operations("outer") == made.operations("outer")
    product, total = found.call("outer")(np.array([2.0, 3.0]))
    np.testing.assert_array_equal(product, [[4.0, 6.0], [6.0, 9.0]])
    assert total == 5.0


def test_nothing_is_recalled_that_was_not_kept(cache: Path) -> None:
    outer().keep("outer of two")
    assert Kernel.recalled("outer of three") is None


def test_nothing_is_kept_of_the_virtual_machine(cache: Path) -> None:
    outer("vm").keep("outer of two")
    assert Kernel.recalled("outer of two") is None


@pytest.mark.parametrize("suffix", ["json", "so"])
@pytest.mark.parametrize("damage", [Path.unlink, lambda path: path.write_bytes(b"x" * 100)])
def test_what_is_gone_or_damaged_is_built_again(cache: Path, suffix: str, damage: object) -> None:
    outer().keep("outer of two")
    for path in cache.glob(f"*.{suffix}"):
        damage(path)  # type: ignore[operator]
    assert Kernel.recalled("outer of two") is None
    outer().keep("outer of two")
    assert Kernel.recalled("outer of two") is not None
