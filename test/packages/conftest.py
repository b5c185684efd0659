# SPDX-License-Identifier: Apache-2.0
"""Wheels, and an environment where they are installed; each is made once."""

from __future__ import annotations

from pathlib import Path

import pytest
from installed import Run, bare_environment, built, copied, runner


@pytest.fixture(scope="session")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project."""
    return copied(tmp_path_factory.mktemp("project"))


@pytest.fixture(scope="session")
def wheels(project: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A wheel of each library and one of both."""
    parts = ["./src/arm_dynamics", "./src/arm_sim", "."]
    return built(project, tmp_path_factory.mktemp("wheels"), parts)


@pytest.fixture(scope="session")
def user(wheels: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Runs commands where the wheels of the two libraries are installed."""
    folder = tmp_path_factory.mktemp("user")
    run = runner(bare_environment(folder / "environment"), folder)
    run("python", "-m", "pip", "install", wheels["arm_dynamics"], wheels["arm_sim"])
    return run
