# SPDX-License-Identifier: Apache-2.0
"""Wheels, and an environment where they are installed; each is made once."""

from pathlib import Path

import pytest
from installed import Run, bare_environment, built, copied, runner


@pytest.fixture(scope="session")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project."""
    return copied(tmp_path_factory.mktemp("project"))


@pytest.fixture(scope="session")
def wheels(project: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A wheel of each library and one of all."""
    parts = ["./src/arm_dynamics", "./src/arm_sim", "./src/arm_studies", "."]
    return built(project, tmp_path_factory.mktemp("wheels"), parts)


@pytest.fixture(scope="session")
def user(wheels: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Runs commands where the wheels of the libraries are installed."""
    folder = tmp_path_factory.mktemp("user")
    run = runner(bare_environment(folder / "environment"), folder)
    parts = [wheels[name] for name in ("arm_dynamics", "arm_sim", "arm_studies")]
    run("python", "-m", "pip", "install", *parts)
    return run
