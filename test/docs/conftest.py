# SPDX-License-Identifier: Apache-2.0
"""What runs the commands of pages, and the examples."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from terminal import forging


@pytest.fixture(scope="session")
def forge(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Its socket."""
    with forging(tmp_path_factory.mktemp("forge")) as made:
        yield made
