# SPDX-License-Identifier: Apache-2.0
"""A scene that is exact already is not lost by chance; one that predicts worse is refused."""

import numpy as np
import pytest

from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification import identify
from benchmarks.identification.coverage import ARMS, disturbed, true_arm

ARM = true_arm(ARMS["two links"])


def test_an_exact_scene_passes_whatever_the_noise():
    """Estimates from noise predict worse than it in most of the recordings, by up to a tenth."""
    ratios, told = [], 0
    for seed in range(8):
        found = identify(ARM.scene, disturbed(ARM, seed, more=0.0))
        ratios.append(found.error[0] / found.error[1])
        told += any("predicts the part held out better" in note for note in found.notes)
    assert max(ratios) > 1.05
    assert told == np.count_nonzero(np.array(ratios) > 1.0)


def test_a_scene_of_too_much_friction_is_refused():
    with pytest.raises(InvalidInput, match=r"more than noise explains \(\d.*allowed: up to 2\.5"):
        identify(ARM.scene, disturbed(ARM, 0, more=0.5))
