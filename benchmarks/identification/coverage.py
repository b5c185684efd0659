# SPDX-License-Identifier: Apache-2.0
"""Whether 95 % intervals contain the truth: ``python -m benchmarks.identification.coverage``.

Six arms have bodies up to a fifth off the nominal ones, rotors and friction that the nominal scene
does not have; the tutorial's has a payload instead. Each follows a motion under a controller with
the nominal scene, and is recorded by sensors of three kinds, each with seeds of its own of motion
and noise. For a fourth kind, ``lagrange``, torques follow from Lagrange's equations, and one
motion is the same for all seeds, so that an error which is always the same shows as a bias.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import click
import numpy as np

from arm_dynamics import ArmModel, Dynamics, load_scene
from arm_dynamics.arrays import Array
from arm_dynamics.control import ComputedTorque
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.trajectory import Reference
from arm_sim import Recording, Simulator
from arm_studies.identification import JointRecord, identify
from arm_studies.identification.regression.regressor import RigidRegressor
from arm_studies.identification.regression.rows.samples import HELD_OUT
from benchmarks.identification.lagrange import LagrangeArm, Link
from benchmarks.reporting.markdown import table

Scene = dict[str, Any]
NOISE, RESOLUTION = 0.05, 1e-4
"""Of efforts, relative to each joint's root mean square; of positions in [rad] or [m]."""
OFF = 0.2
"""Largest relative error of masses and inertias in the nominal scene."""
PERIOD, DURATION, RATE, HARMONICS = 10.0, 30.0, 200.0, 6
"""Of the motion and the recording in [s], and of its samples in [Hz]."""
TICK, ROUND, TURNS, TONES = 2e-3, 5.0, 2, 5
"""Of simulated recordings: tick and period in [s], periods and harmonics."""
ONE_ROUND = np.linspace(0.0, ROUND, 500)
"""Times in [s] of its states."""
QUIET = 0.02
"""Of these: noise of efforts, as above."""
PUBLISHED = 2
"""Ticks from one message of ``joint_states`` to the next."""
KINDS = ("noisy", "filtered", "joint_states")
LAGRANGE, TUTORIAL = "lagrange", "tutorial"
URDF = "package://arm_sim/scenes/two_link.urdf"

ARMS: dict[str, tuple[Link, ...]] = {
    "two links": (
        Link("shoulder", (0, 0, 0.1), 0.0, 1, False, 3.0, (0.2, 0, 0.01),
             (0.01, 0.001, 0, 0.04, 0, 0.041)),
        Link("elbow", (0.4, 0, 0), 0.1, 1, False, 1.5, (0.15, 0.01, 0),
             (0.004, 0, 0, 0.012, 0, 0.0121)),
    ),
    "three joints": (
        Link("base", (0, 0, 0.3), 0.0, 2, False, 5.0, (0.01, 0.02, 0.1),
             (0.04, 0.001, -0.002, 0.04, 0.003, 0.02)),
        Link("shoulder", (0, 0.05, 0.1), 0.0, 1, False, 3.0, (0.2, 0.01, 0),
             (0.01, 0.001, 0, 0.05, 0.001, 0.05)),
        Link("elbow", (0.4, -0.05, 0), 0.0, 1, False, 1.5, (0.15, 0, 0.01),
             (0.004, 0, 0.001, 0.015, 0, 0.015)),
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
NAMES = (TUTORIAL, *ARMS)


def true_arm(links: tuple[Link, ...], seed: int = 100) -> LagrangeArm:
    """An arm whose bodies are off the given ones, with rotors and friction."""
    rng, bodies = np.random.default_rng(seed), []
    for link in links:
        factor, shape = rng.uniform(1.0 - OFF, 1.0 + OFF, 2)
        bodies.append(replace(
            link, mass=factor * link.mass,
            com=tuple(x + rng.uniform(-0.01, 0.01) for x in link.com),
            inertia=tuple(shape * x for x in link.inertia),
        ))  # fmt: skip
    n = len(links)
    return LagrangeArm(tuple(bodies), rng.uniform(0.02, 0.1, n), *rng.uniform(0.3, 1.0, (2, n)))


@dataclass(frozen=True)
class Fourier:
    """A Fourier series of each joint, up to a radian or 0.3 m."""

    sines: Array  # shape (tones, n)
    cosines: Array  # shape (tones, n)
    period: float  # in [s]

    @classmethod
    def of(cls, seed: int, slides: list[bool], period: float, tones: int, t: Array) -> Fourier:
        series = cls(*np.random.default_rng(seed).normal(size=(2, tones, len(slides))), period)
        size = np.where(slides, 0.3, 1.0) / abs(series.sample(t).q).max(axis=0)
        return cls(size * series.sines, size * series.cosines, period)

    def sample(self, t: float | Array) -> Reference:
        """Position, velocity and acceleration, shapes (n,) or (k, n)."""
        w = 2.0 * np.pi / self.period * np.arange(1, len(self.sines) + 1)
        s, c = np.sin(np.multiply.outer(t, w)), np.cos(np.multiply.outer(t, w))
        return Reference(
            s @ self.sines + c @ self.cosines,
            (c * w) @ self.sines - (s * w) @ self.cosines,
            -(s * w**2) @ self.sines - (c * w**2) @ self.cosines,
        )


def recorded(arm: LagrangeArm, duration: float) -> tuple[Array, Array, Array]:
    t = np.arange(0.0, duration, 1.0 / RATE)
    motion = Fourier.of(7, [link.slides for link in arm.links], PERIOD, HARMONICS, t).sample(t)
    return t, motion.q, arm.torque(motion.q, motion.v, motion.a)


def noisy(tau: Array, rng: np.random.Generator) -> Array:
    return tau + NOISE * np.sqrt((tau**2).mean(axis=0)) * rng.standard_normal(tau.shape)


def disturbed(arm: LagrangeArm, seed: int, more: float) -> JointRecord:
    """A recording with a fraction more of friction in the first joint, except where held out."""
    t, q, tau = recorded(arm, DURATION)
    effort = noisy(tau, np.random.default_rng(seed))
    way = np.sign(np.gradient(q[:, 0], t)) * (t < (1.0 - HELD_OUT) * DURATION)
    effort[:, 0] += more * arm.coulomb[0] * way
    return JointRecord.of(arm.names, t, RESOLUTION * np.round(q / RESOLUTION), effort)


@cache
def scenes(name: str) -> tuple[Scene, Scene]:
    """An arm, and its nominal scene."""
    if name != TUTORIAL:
        nominal = LagrangeArm(ARMS[name], *np.zeros((3, len(ARMS[name]))))
        return true_arm(ARMS[name]).scene, {"robot": {"urdf": nominal.urdf}}
    friction = {
        "shoulder": {"friction": {"viscous": 0.9, "coulomb": 1.2}},
        "elbow": {"friction": {"viscous": 0.3, "coulomb": 0.5}},
    }
    tip = {"frame": "tip", "mass": 0.4, "inertia": [1e-4, 0, 0, 1e-4, 0, 1e-4]}
    nominal = {"robot": {"urdf": URDF}}
    return {**nominal, "joints": friction, "payloads": [tip]}, nominal


@cache
def truth(name: str) -> dict[str, float]:
    """True parameters by the names of an identification."""
    real, nominal = (ArmModel(load_scene(scene)) for scene in scenes(name))
    theta = (mine := RigidRegressor(real)).nominal + mine.payload
    values = base_truth(RigidRegressor(nominal), theta, real.armature)
    for joint in real.joint_names:
        friction = real.scene.joint(joint).friction
        for key in ("viscous", "coulomb"):
            values[f"{joint}.{key}"] = float(np.mean(getattr(friction, key)))
    return values


def base_truth(regressor: RigidRegressor, theta: Array, armature: Array) -> dict[str, float]:
    """True base parameters by the names that ``identify`` gives them."""
    base = regressor.base
    values = base.of(np.concatenate([armature, theta]))
    return dict(zip(base.names, values.tolist(), strict=True))


def sensors(kind: str, seed: int, effort: Mapping[str, float]) -> Scene:
    """The sensors of a kind."""
    noise = {"noise": {joint: QUIET * size for joint, size in effort.items()}}
    position, cutoff = ("resolution", 20) if kind == "filtered" else ("noise", 60)
    sensors = {"position": {position: 2e-5}, "velocity": {"from": "position", "cutoff": cutoff}}
    return {"sensors": {"seed": seed, "effort": noise, **sensors}}


@cache
def efforts(name: str) -> dict[str, float]:
    dynamics = Dynamics(scenes(name)[0])
    motion = followed(name, 0).sample(ONE_ROUND)
    tau = dynamics.inverse(motion.q, motion.v, motion.a)
    sizes = np.sqrt((tau**2).mean(axis=0)).tolist()
    return dict(zip(dynamics.joint_names, sizes, strict=True))


def followed(name: str, seed: int) -> Fourier:
    """The motion of a simulated recording."""
    kinds = ArmModel(load_scene(scenes(name)[1])).joint_types
    slides = [kind == "prismatic" for kind in kinds]
    return Fourier.of(seed, slides, ROUND, TONES, ONE_ROUND)


def simulated(name: str, kind: str, seed: int) -> Recording:
    real, nominal = scenes(name)
    sim = Simulator({**real, **sensors(kind, seed, efforts(name))}, dt=TICK)
    motion = followed(name, seed)
    start = motion.sample(0.0)
    sim.reset(start.q, start.v)
    return sim.run(ROUND * TURNS, ComputedTorque(Dynamics(nominal), dt=TICK), motion)


def through_joint_states(run: Recording) -> JointRecord:
    """What a bag of the topic ``joint_states`` says, of every so many ticks."""
    with tempfile.TemporaryDirectory() as folder:
        path = run.save(Path(folder) / "run.mcap")
        bag = Recording.load(path, topic="/joint_states")
    kept = JointRecord.from_recording(bag)
    return kept.rows(slice(None, None, PUBLISHED))


def along_one_motion(name: str, seed: int) -> JointRecord:
    """Positions in steps of an encoder, and noisy torques by Lagrange's equations."""
    arm, rng = true_arm(ARMS[name]), np.random.default_rng(1000 + seed)
    t, q, tau = recorded(arm, DURATION)
    effort = noisy(tau, rng)
    off = RESOLUTION * rng.uniform(size=q.shape[1])
    steps = RESOLUTION * np.round((q + off) / RESOLUTION) - off
    return JointRecord.of(arm.names, t, steps, effort)


@dataclass(frozen=True)
class Outcome:
    """Of one identification."""

    errors: dict[str, float]  # errors of the parameters over half their interval, by name
    scatter: frozenset[str]  # parameters whose interval is called scatter
    torque_error: float  # relative, on the part held out


def outcome(name: str, kind: str, seed: int) -> Outcome | None:
    """Identify an arm from one recording; None if it is refused, and why is printed."""
    run: Any = along_one_motion(name, seed) if kind == LAGRANGE else simulated(name, kind, seed)
    record = through_joint_states(run) if kind == "joint_states" else run
    try:
        identification = identify(scenes(name)[1], record, accept_worse=True)
    except InvalidInput as refused:
        print(f"  {name}, {kind}, {seed}: {refused}", flush=True)
        return None
    true, errors = truth(name), dict[str, float]()
    for parameter, (low, high) in identification.intervals.items():
        # Friction does not fall with speed: a velocity at which it does has no true value.
        invented = parameter.endswith("stribeck_velocity")
        off = identification.parameters[parameter] - true.get(parameter, 0.0)
        errors[parameter] = np.inf if invented else off / max(0.5 * (high - low), 1e-300)
    return Outcome(errors, identification.scatter, identification.error[0])


def summary(outcomes: Sequence[Outcome]) -> dict[str, float]:
    """Shares of intervals that contain the truth, of all parameters and of friction."""
    errors = [
        (p, abs(e) <= 1.0, p in one.scatter) for one in outcomes for p, e in one.errors.items()
    ]
    judged = [(p, held) for p, held, scatter in errors if not scatter]
    rubs = [held for p, held in judged if p.endswith(("viscous", "coulomb"))]
    mean = lambda values: float(np.mean(values)) if values else np.nan  # noqa: E731
    return {
        "intervals": len(errors), "scatter": mean([s for *_, s in errors]),
        "held": mean([held for _, held in judged]), "held, friction": mean(rubs),
        "torque error": mean([one.torque_error for one in outcomes]),
    }  # fmt: skip


@click.command()
@click.option("--arm", "arms", multiple=True, type=click.Choice(NAMES), help="[default: all]")
@click.option("--kind", "kinds", multiple=True, type=click.Choice([*KINDS, LAGRANGE]),
              help="[default: the simulated ones]")  # fmt: skip
@click.option("--seeds", default=12, show_default=True, help="Recordings of each arm and kind.")
@click.option("--first", default=1, show_default=True, help="The first seed.")
def main(arms: tuple[str, ...], kinds: tuple[str, ...], seeds: int, first: int) -> None:
    """How often 95 % intervals of identified arms contain the truth."""
    rows = []
    for name in arms or NAMES:
        for place, kind in enumerate(kinds or KINDS):
            if (name, kind) == (TUTORIAL, LAGRANGE):
                continue  # has no such equations
            start = first + place * seeds
            tried = [outcome(name, kind, seed) for seed in range(start, start + seeds)]
            outcomes = [one for one in tried if one is not None]
            one = summary(outcomes) | {"refused": seeds - len(outcomes)}
            rows.append([name, kind, *(f"{value:.3g}" for value in one.values())])
            print(rows[-1], flush=True)
    print(table(("arm", "sensors", *one), rows))


if __name__ == "__main__":
    main(prog_name="python -m benchmarks.identification.coverage")
