# SPDX-License-Identifier: Apache-2.0
"""Recordings of the arm of two links of ``coverage`` with one fault of the elbow's column each."""

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


def _lost(q: Array, effort: Array) -> None:
    q[np.random.default_rng(2).random(len(q)) < SHARE, ELBOW] = np.nan


def _stretch(held: bool) -> Fault:
    def fault(q: Array, effort: Array) -> None:
        effort[SPAN, ELBOW] = effort[SPAN.start, ELBOW] if held else 0.0

    return fault


def _late(seconds: float) -> Fault:
    def fault(q: Array, effort: Array) -> None:
        at = np.arange(len(effort)) - seconds * RATE
        effort[:, ELBOW] = np.interp(at, np.arange(len(effort)), effort[:, ELBOW])

    return fault


def _mixed(*rows: tuple[float, float]) -> Fault:
    def fault(q: Array, effort: Array) -> None:
        effort[:] = effort @ np.array(rows).T

    return fault


FAULTS: dict[str, Fault] = {
    "5 % of the positions missing": _lost,
    "efforts frozen for 2 s": _stretch(held=True),
    "efforts 0 for 2 s": _stretch(held=False),
    "efforts ahead by 12 ms": _late(-0.012),
    "efforts late by 100 ms": _late(0.1),
    "efforts times 0.5": _mixed((1.0, 0.0), (0.0, 0.5)),
    "efforts times 1000": _mixed((1.0, 0.0), (0.0, 1000.0)),
    "columns of efforts swapped": _mixed((0.0, 1.0), (1.0, 0.0)),
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
