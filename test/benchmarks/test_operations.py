# SPDX-License-Identifier: Apache-2.0
"""Changes that make a scene's equations longer are noticed."""

import pytest
from samples import sampled

from benchmarks.regression import operations

SCENES, RECORDED = operations.scenes(), operations.recorded()


def test_every_scene_is_counted() -> None:
    assert SCENES.keys() == RECORDED.keys(), "python -m benchmarks.regression.operations --renew"


@pytest.mark.parametrize("name", sampled(sorted(SCENES.keys() & RECORDED.keys()), 18))
def test_an_evaluation_takes_no_more_operations_than_before(name: str) -> None:
    assert operations.count(SCENES[name]) <= RECORDED[name]
