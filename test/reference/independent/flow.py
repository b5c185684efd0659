# SPDX-License-Identifier: Apache-2.0
"""What a law does to one joint at an instant, and the account of its energies."""

from typing import NamedTuple

import numpy as np

Array = np.ndarray


class Flow(NamedTuple):
    """Torque on the joint [N m], rates of the law's states, energy [J] and powers [W]."""

    torque: float
    slope: tuple[float, ...] = ()
    stored: float = 0.0
    supplied: float = 0.0
    lost: float = 0.0


class Law:
    """Something that acts on one joint.

    Absolute values are written sign · value with signs that do not change between two events, so
    that a law is smooth there; ``kinks`` are the values whose signs these are.
    """

    joint: int
    size = 0

    def initial(self, q: float, v: float) -> tuple[float, ...]:
        """States of an arm that has just been put down; by default zeros."""
        return (0.0,) * self.size

    def kinks(self, q: float, v: float, z: Array) -> tuple[float, ...]:
        """What changes the law where it goes through zero; by default nothing."""
        return ()

    def flow(self, q: float, v: float, z: Array, u: float, signs: Array) -> Flow:
        """What it does under the command u."""
        raise NotImplementedError
