# SPDX-License-Identifier: Apache-2.0
"""What a page shows, without a browser."""

from __future__ import annotations

import numpy as np
import pytest

import models
from arm_sim.view import Film, show

pytestmark = pytest.mark.group("view")


def test_motions_of_one_name_are_told_apart() -> None:
    model = models.dynamics("two_link").model
    films = [Film(name, model, np.arange(3.0), np.zeros((3, 2))) for name in ("a", "b", "a")]
    with show(*films, port=0) as view:
        assert [actor.name for actor in view.actors] == ["a 1", "b", "a 2"]
