# SPDX-License-Identifier: Apache-2.0
"""Joint states of all joints of the description, including locked and mimic joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.model.description import AllJoints


class AllJointStates:
    """Arrays for all joints, filled from those of the arm's joints.

    Attributes:
        arrays: Positions, velocities and efforts, each of shape (len(joints.names),).
    """

    def __init__(self, joints: AllJoints, own: Sequence[Array]) -> None:
        """Use these joints, and the published arrays of the arm's own joints."""
        self._joints, self._own = joints, tuple(own)
        self.arrays = tuple(np.zeros(len(joints.names)) for _ in own)

    def fill(self) -> None:
        """Copy the current contents of the arm's arrays."""
        (q, v, tau), (all_q, all_v, all_tau) = self._own, self.arrays
        all_q[:] = self._joints.positions(q)
        all_v[:] = self._joints.velocities(v)
        all_tau[: tau.size] = tau
