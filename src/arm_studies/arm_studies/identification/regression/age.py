# SPDX-License-Identifier: Apache-2.0
"""The time by which efforts are older than the positions beside them, where it is not stated."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from arm_studies.identification.regression.intervals import CERTAIN

# Largest number of corrections of the age; standard errors below which one is left out; largest
# age in periods of the band.
CORRECTIONS, SETTLED, OLDEST = 4, 0.2, 0.15


def age_of(
    measured: Callable[[float], tuple[float, float]], band: float
) -> tuple[float, list[str]]:
    """The age of efforts in [s], and a note if it is significant.

    Args:
        measured: Returns the correction of an age at which efforts are compared with the motion,
            and its standard deviation; called last with the age that is returned.
        band: Of the low-pass filter in [Hz].
    """
    age, farthest = 0.0, OLDEST / band
    step, doubt = measured(age)
    for _ in range(CORRECTIONS):
        if not abs(step) > SETTLED * doubt:
            break
        age = float(np.clip(age + step, -farthest, farthest))
        step, doubt = measured(age)
    if not abs(age) > CERTAIN * doubt:
        return age, []
    return age, [
        f"efforts are {1e3 * age:.2g} ± {1e3 * CERTAIN * doubt:.1g} ms older than the positions "
        "beside them; they are compared with the motion at that time"
    ]
