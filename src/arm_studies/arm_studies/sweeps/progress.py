# SPDX-License-Identifier: Apache-2.0
"""Progress of a sweep."""

from __future__ import annotations

from arm_dynamics.attributes import frozen
from arm_studies.renaming import renamed_attribute


@frozen
class Progress:
    """Progress of a sweep.

    Attributes:
        done: Number of finished runs, earlier ones included.
        total: Number of all runs.
        remaining: Remaining time in [s]; None while too little is known.
        activity: What is being done.
    """

    done: int
    total: int
    remaining: float | None
    activity: str
    what = renamed_attribute("what", "activity")
