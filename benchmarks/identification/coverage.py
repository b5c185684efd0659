# SPDX-License-Identifier: Apache-2.0
"""Whether 95 % intervals contain the truth: ``python -m benchmarks.identification.coverage``.

Arms are those of ``lagrange``: bodies up to a fifth off the nominal ones, rotors and friction that
the nominal scene does not have. Only positions are given, in steps of an encoder, and efforts with
white noise. An arm and its motion stay as they are from seed to seed, so that an error which is
always the same shows as a bias.
"""

from __future__ import annotations

import json
import re
import time
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification import Identification, JointRecord, identify
from benchmarks.identification.lagrange import LagrangeArm, Link
from benchmarks.reporting.markdown import table

NOISE, RESOLUTION = 0.05, 1e-4
"""Of efforts, relative to each joint's root mean square; of positions in [rad] or [m]."""
OFF = 0.2
"""Largest relative error of masses and inertias in the nominal scene."""
PERIOD, DURATION, RATE = 10.0, 30.0, 200.0
"""Of the motion and the recording in [s], and of its samples in [Hz]."""
HARMONICS = 6
CERTAIN = 1.96
NUMBERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")

ARMS: dict[str, tuple[Link, ...]] = {
    "two links": (
        Link("shoulder", (0, 0, 0.1), 0.0, 1, False, 3.0, (0.2, 0, 0.01),
             (0.01, 0.001, 0, 0.04, 0, 0.041)),
        Link("elbow", (0.4, 0, 0), 0.1, 1, False, 1.5, (0.15, 0.01, 0),
             (0.004, 0, 0, 0.012, 0, 0.0121)),
    ),
    "four skew joints": (
        Link("base", (0, 0, 0.3), 0.0, 2, False, 4.0, (0.02, 0.01, 0.1),
             (0.03, 0.001, -0.002, 0.04, 0.003, 0.02)),
        Link("shoulder", (0.05, 0, 0.1), 0.2, 1, False, 3.0, (0.2, 0.01, 0.02),
             (0.01, 0.001, -0.002, 0.05, 0.003, 0.05)),
        Link("elbow", (0.4, 0.02, 0), -0.3, 1, False, 2.0, (0.15, -0.03, 0.02),
             (0.006, 0.001, 0, 0.02, 0, 0.02)),
        Link("wrist", (0.3, 0, 0), 0.5, 0, False, 0.8, (0.05, -0.03, 0.04),
             (0.002, 0.0002, 0, 0.003, 0, 0.0025)),
    ),
    "scara": (
        Link("shoulder", (0, 0, 0.3), 0.0, 2, False, 6.0, (0.15, 0.01, 0.02),
             (0.03, 0.001, -0.002, 0.06, 0.003, 0.06)),
        Link("elbow", (0.3, 0, 0), 0.0, 2, False, 4.0, (0.12, 0.01, 0.02),
             (0.01, 0.001, -0.002, 0.03, 0.003, 0.03)),
        Link("slide", (0.25, 0, 0), 0.0, 2, True, 2.0, (0.02, -0.01, 0.02),
             (0.006, 0.001, 0, 0.006, 0, 0.002)),
        Link("turn", (0, 0, 0), 0.0, 2, False, 0.8, (0.04, -0.01, 0.04),
             (0.002, 0.0002, 0, 0.003, 0, 0.0025)),
    ),
    "six joints": (
        Link("joint1", (0, 0, 0.3), 0.0, 2, False, 8.0, (0.02, 0.01, 0.05),
             (0.05, 0.001, -0.002, 0.05, 0.003, 0.04)),
        Link("joint2", (0, 0.1, 0.1), 0.0, 1, False, 7.0, (0, 0.02, 0.2),
             (0.15, 0.001, -0.002, 0.15, 0.003, 0.03)),
        Link("joint3", (0, -0.05, 0.45), 0.0, 1, False, 4.0, (0.02, -0.01, 0.12),
             (0.05, 0.001, 0, 0.05, 0, 0.01)),
        Link("joint4", (0, 0, 0.3), 0.0, 2, False, 1.6, (0.01, -0.01, 0.05),
             (0.006, 0.0002, 0, 0.006, 0, 0.002)),
        Link("joint5", (0, 0, 0.1), 0.0, 1, False, 1.2, (0, 0.01, 0.04),
             (0.002, 0, 0, 0.002, 0, 0.001)),
        Link("joint6", (0, 0, 0.08), 0.0, 2, False, 0.5, (0.02, 0.01, 0.05),
             (0.001, 0.0001, 0, 0.001, 0, 0.0005)),
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Study:
    """What came out of identifications of one arm with different noise.

    Attributes:
        held: Of every interval, whether it contains the truth, shape (k,).
        held_friction: The same of friction only.
        errors: Errors of the estimates over their standard deviations by parameter, a row each.
        torque_error: Mean relative error of the torques held out.
        seconds: Mean processor time.
    """

    held: Array
    held_friction: Array
    errors: tuple[Array, ...]
    torque_error: float
    seconds: float

    @property
    def bias(self) -> float:
        """Bias over standard error, root mean square over parameters, without chance."""
        means = np.array([errors.mean() for errors in self.errors])
        chance = np.mean([errors.var() / len(errors) for errors in self.errors])
        return float(np.sqrt(max(0.0, np.mean(means**2) - chance)))


def study(
    name: str, seeds: int, noise: float = NOISE, resolution: float = RESOLUTION,
    duration: float = DURATION,
) -> Study:  # fmt: skip
    """Identify an arm of ``ARMS`` once for each seed."""
    nominal = LagrangeArm(ARMS[name], *np.zeros((3, len(ARMS[name]))))
    arm = true_arm(ARMS[name])
    truth = numbers_of(arm)
    t, q, tau = recorded(arm, duration)
    found, begun = [], time.process_time()
    for seed in range(seeds):
        rng = np.random.default_rng(1000 + seed)
        effort = tau + noise * np.sqrt((tau**2).mean(axis=0)) * rng.standard_normal(tau.shape)
        off = resolution * rng.uniform(size=q.shape[1])
        steps = resolution * np.round((q + off) / resolution) - off
        record = JointRecord.of(arm.names, t, steps, effort)
        found.append(identify({"robot": {"urdf": nominal.urdf}}, record))
    seconds = (time.process_time() - begun) / seeds
    return _judged(found, truth, seconds)


def _judged(found: list[Identification], truth: dict[str, float], seconds: float) -> Study:
    errors = dict[str, list[float]]()
    held, friction = list[bool](), list[bool]()
    for one in found:
        for name, (low, high) in one.intervals.items():
            if name.endswith("stribeck_velocity"):
                continue  # friction does not fall with speed, so that there is no true one
            true = combined(name, truth)
            held.append(low <= true <= high)
            if name.endswith(("viscous", "coulomb")):
                friction.append(held[-1])
            deviation = (high - low) / (2.0 * CERTAIN)
            errors.setdefault(name, []).append((one.parameters[name] - true) / deviation)
    often = [np.array(each) for each in errors.values() if 2 * len(each) > len(found)]
    error = float(np.mean([one.error[0] for one in found]))
    return Study(np.array(held), np.array(friction), tuple(often), error, seconds)


def true_arm(links: tuple[Link, ...], seed: int = 100) -> LagrangeArm:
    """An arm whose bodies are off the given ones, with rotors and friction."""
    rng, found = np.random.default_rng(seed), []
    for link in links:
        factor, shape = rng.uniform(1.0 - OFF, 1.0 + OFF, 2)
        found.append(replace(
            link, mass=factor * link.mass,
            com=tuple(x + rng.uniform(-0.01, 0.01) for x in link.com),
            inertia=tuple(shape * x for x in link.inertia),
        ))  # fmt: skip
    n = len(links)
    return LagrangeArm(
        tuple(found), rng.uniform(0.02, 0.1, n), rng.uniform(0.3, 1.0, n), rng.uniform(0.3, 1.0, n)
    )


def recorded(arm: LagrangeArm, duration: float) -> tuple[Array, Array, Array]:
    """Times, positions and torques of a Fourier series of each joint, up to a radian or 0.3 m."""
    rng, n = np.random.default_rng(7), len(arm.links)
    t = np.arange(0.0, duration, 1.0 / RATE)
    w = 2.0 * np.pi / PERIOD * np.arange(1, HARMONICS + 1)
    a, b = rng.normal(size=(2, HARMONICS, n))
    s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    size = np.where([link.slides for link in arm.links], 0.3, 1.0) / abs(s @ a + c @ b).max(axis=0)
    a, b = size * a, size * b
    v, acceleration = (c * w) @ a - (s * w) @ b, -(s * w**2) @ a - (c * w**2) @ b
    q = s @ a + c @ b
    return t, q, arm.torque(q, v, acceleration)


def numbers_of(arm: LagrangeArm) -> dict[str, float]:
    """True parameters by the names of an identification."""
    found = dict[str, float]()
    for j, link in enumerate(arm.links):
        pairs = zip(NUMBERS, link.numbers.tolist(), strict=True)
        found |= {f"{link.name}.{number}": value for number, value in pairs}
        for key in ("armature", "viscous", "coulomb"):
            found[f"{link.name}.{key}"] = float(getattr(arm, key)[j])
    return found


def combined(name: str, truth: dict[str, float]) -> float:
    """The true value of a base parameter such as ``elbow.Izz - 0.4 elbow.mx``; else 0."""
    total, factor = 0.0, 1.0
    for word in name.split():
        if word in "+-":
            factor = 1.0 if word == "+" else -1.0
        elif re.fullmatch(r"[\d.e+-]+", word):
            factor *= float(word)
        else:
            total += factor * truth.get(word, 0.0)
    return total


@click.command()
@click.option("--arm", "arms", multiple=True, type=click.Choice(list(ARMS)),
              help="An arm; may be repeated.  [default: all]")  # fmt: skip
@click.option("--seeds", default=20, show_default=True, help="Recordings of each arm.")
@click.option("--noise", default=NOISE, show_default=True, help="Of the efforts, relative.")
@click.option("--resolution", default=RESOLUTION, show_default=True,
              help="Of the positions in rad or m.")  # fmt: skip
@click.option("--out", default=Path("reports/coverage.json"), show_default=True,
              type=click.Path(path_type=Path), help="JSON file for the results.")  # fmt: skip
def main(
    arms: tuple[str, ...], seeds: int, noise: float, resolution: float, out: Path
) -> None:  # fmt: skip
    """How often 95 % intervals of identified arms contain the truth, and how biased they are."""
    columns = ("arm", "intervals", "held", "of friction", "bias / standard error", "torque error",
               "processor time [s]")  # fmt: skip
    rows, told = [], {}
    for name in arms or ARMS:
        one = study(name, seeds, noise, resolution)
        told[name] = {
            "intervals": one.held.size, "held": float(one.held.mean()),
            "held, friction": float(one.held_friction.mean()), "bias": one.bias,
            "torque error": one.torque_error, "seconds": one.seconds,
        }  # fmt: skip
        values = list(told[name].values())
        rows.append([name, *(f"{value:.3g}" for value in values)])
        print(rows[-1], flush=True)
    print(table(columns, rows))
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(told, indent=1))


if __name__ == "__main__":
    main(prog_name="python -m benchmarks.identification.coverage")
