# SPDX-License-Identifier: Apache-2.0
"""A page's server, for what is drawn on it."""

from collections.abc import Iterator
from typing import Any

import pytest

from arm_sim.view.server import close_server, open_server


@pytest.fixture
def server() -> Iterator[Any]:
    opened = open_server("arm", port=0)
    yield opened
    close_server(opened)
