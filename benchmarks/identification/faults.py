# SPDX-License-Identifier: Apache-2.0
"""Recordings of the arm of two links of ``coverage`` with one fault of the elbow's column each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification import JointRecord, identify
from benchmarks.identification.coverage import ARMS, RATE, RESOLUTION, noisy, recorded, true_arm
from benchmarks.identification.lagrange import LagrangeArm

Fault = Callable[[Array, Array], None]
"""Changes positions and efforts of shape (k, 2) in place."""
ELBOW, SHARE, DURATION = 1, 0.05, 60.0
SPAN = slice(int(8.0 * RATE), int(10.0 * RATE))


def _lost(array: Array) -> None:
    array[np.random.default_rng(2).random(len(array)) < SHARE, ELBOW] = np.nan


def _stretch(effort: Array, value: float) -> None:
    effort[SPAN, ELBOW] = value


def _late(effort: Array, seconds: float) -> None:
    at = np.arange(len(effort)) - seconds * RATE
    effort[:, ELBOW] = np.interp(at, np.arange(len(effort)), effort[:, ELBOW])


def _times(effort: Array, factor: float) -> None:
    effort[:, ELBOW] *= factor


def _swapped(effort: Array) -> None:
    effort[:] = effort[:, ::-1].copy()


FAULTS: dict[str, Fault] = {
    "none": lambda q, effort: None,
    "5 % of the efforts missing": lambda q, effort: _lost(effort),
    "5 % of the positions missing": lambda q, effort: _lost(q),
    "efforts missing for 2 s": lambda q, effort: _stretch(effort, np.nan),
    "efforts frozen for 2 s": lambda q, effort: _stretch(effort, effort[SPAN.start, ELBOW]),
    "efforts 0 for 2 s": lambda q, effort: _stretch(effort, 0.0),
    "efforts late by 12 ms": lambda q, effort: _late(effort, 0.012),
    "efforts ahead by 12 ms": lambda q, effort: _late(effort, -0.012),
    "efforts late by 100 ms": lambda q, effort: _late(effort, 0.1),
    "efforts times 0.5": lambda q, effort: _times(effort, 0.5),
    "efforts times 3": lambda q, effort: _times(effort, 3.0),
    "efforts times 1000": lambda q, effort: _times(effort, 1000.0),
    "efforts reversed": lambda q, effort: _times(effort, -1.0),
    "columns of efforts swapped": lambda q, effort: _swapped(effort),
}


def diagnosis(fault: Fault, seed: int = 0) -> tuple[float | None, tuple[str, ...]]:
    """Error on the part held out, None if no scene is written; and what is said."""
    links = ARMS["two links"]
    arm, nominal = true_arm(links), LagrangeArm(links, *np.zeros((3, len(links))))
    t, q, tau = recorded(arm, DURATION)
    effort = noisy(tau, np.random.default_rng(seed))
    q = RESOLUTION * np.round(q / RESOLUTION)
    fault(q, effort)
    record = JointRecord.of(arm.names, t, q, effort)
    try:
        identification = identify({"robot": {"urdf": nominal.urdf}}, record)
    except InvalidInput as refused:
        return None, (str(refused),)
    return identification.error[0], identification.notes
