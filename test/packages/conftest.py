# SPDX-License-Identifier: Apache-2.0
"""Wheels, and an environment where the suite is installed; each is made once."""

from pathlib import Path

import pytest
from installed import Run, bare_environment, built, copied, runner, steps


@pytest.fixture(scope="session")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project."""
    return copied(tmp_path_factory.mktemp("project"))


@pytest.fixture(scope="session")
def wheels(project: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A wheel of each library."""
    parts = ["./src/arm_dynamics", "./src/arm_sim", "./src/arm_studies"]
    return built(project, tmp_path_factory.mktemp("wheels"), parts)


@pytest.fixture(scope="session")
def user(project: Path, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Runs commands where the suite is installed as the workflow does it."""
    folder = tmp_path_factory.mktemp("user")
    run = runner(bare_environment(folder / "environment"), folder)
    run("bash", "-euc", steps("library")[0], cwd=project)
    return run
