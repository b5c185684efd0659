# SPDX-License-Identifier: Apache-2.0
"""A scene that is exact already is not lost by chance; one that predicts worse is refused."""

import numpy as np
import pytest

from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification import JointRecord, identify
from arm_studies.identification.regression.rows import HELD_OUT
from benchmarks.identification.coverage import (
    ARMS,
    DURATION,
    NOISE,
    RESOLUTION,
    recorded,
    true_arm,
)
from benchmarks.identification.lagrange import LagrangeArm

ARM = true_arm(ARMS["two links"])


def disturbed(arm: LagrangeArm, seed: int, more: float) -> JointRecord:
    """A recording with a fraction more of friction in the first joint, except where held out."""
    t, q, tau = recorded(arm, DURATION)
    noise = np.random.default_rng(seed).standard_normal(tau.shape)
    effort = tau + NOISE * np.sqrt((tau**2).mean(axis=0)) * noise
    way = np.sign(np.gradient(q[:, 0], t)) * (t < (1.0 - HELD_OUT) * DURATION)
    effort[:, 0] += more * arm.coulomb[0] * way
    return JointRecord.of(arm.names, t, RESOLUTION * np.round(q / RESOLUTION), effort)


def test_an_exact_scene_passes_whatever_the_noise():
    """Estimates from noise predict worse than it in most of the recordings, by up to a tenth."""
    ratios, told = [], 0
    for seed in range(8):
        found = identify(ARM.scene, disturbed(ARM, seed, more=0.0))
        ratios.append(found.error[0] / found.error[1])
        told += any("leaves less of the part held out" in note for note in found.notes)
    assert max(ratios) > 1.05
    assert told == np.count_nonzero(np.array(ratios) > 1.0)


@pytest.mark.parametrize("seed", range(3))
def test_a_scene_of_too_much_friction_is_refused(seed):
    with pytest.raises(InvalidInput, match=r"more than noise explains \(\d.*allowed: up to 2\.5"):
        identify(ARM.scene, disturbed(ARM, seed, more=0.5))
