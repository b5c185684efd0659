# SPDX-License-Identifier: Apache-2.0
"""Intervals from simulated recordings: ``python -m benchmarks.identification.simulated``.

Six arms follow a motion under a controller with the nominal scene, and are recorded by sensors of
five kinds, each with a fresh seed of the motion and of the noise. What an interval is worth is the
share of those that contain the truth, without those that ``identify`` calls scatter.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
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
from arm_studies.identification import Identification, JointRecord, identify
from arm_studies.identification.regression.regressor import RigidRegressor
from benchmarks.identification.coverage import ARMS, true_arm
from benchmarks.identification.held_out import exact_scene
from benchmarks.identification.known_truth import base_truth
from benchmarks.identification.lagrange import LagrangeArm, Link
from benchmarks.reporting.markdown import table

Scene = dict[str, Any]
DT, PERIOD, TURNS, HARMONICS = 2e-3, 5.0, 2, 5
NOISE, STEP = 0.02, 4e-4
"""Of efforts, relative to each joint's root mean square; of encoders in [rad] or [m]."""
PUBLISHED = 2
"""Ticks from one message of ``joint_states`` to the next."""
KINDS = ("exact", "noisy", "quantized", "filtered", "joint_states")
TUTORIAL = "tutorial"
LINKS: dict[str, tuple[Link, ...]] = {
    **ARMS,
    "three joints": (
        Link("base", (0, 0, 0.3), 0.0, 2, False, 5.0, (0.01, 0.02, 0.1),
             (0.04, 0.001, -0.002, 0.04, 0.003, 0.02)),
        Link("shoulder", (0, 0.05, 0.1), 0.0, 1, False, 3.0, (0.2, 0.01, 0),
             (0.01, 0.001, 0, 0.05, 0.001, 0.05)),
        Link("elbow", (0.4, -0.05, 0), 0.0, 1, False, 1.5, (0.15, 0, 0.01),
             (0.004, 0, 0.001, 0.015, 0, 0.015)),
    ),
}  # fmt: skip
NAMES = (TUTORIAL, *LINKS)
URDF = "package://arm_sim/scenes/two_link.urdf"


@dataclass(frozen=True)
class Fourier:
    """A Fourier series of each joint, up to a radian or 0.3 m.

    Attributes:
        sines: Shape (HARMONICS, n).
        cosines: Shape (HARMONICS, n).
    """

    sines: Array
    cosines: Array
    duration: float = PERIOD * TURNS

    @classmethod
    def of(cls, seed: int, slides: list[bool]) -> Fourier:
        """A random one."""
        made = cls(*np.random.default_rng(seed).normal(size=(2, HARMONICS, len(slides))))
        path = np.array([made.sample(t).q for t in np.linspace(0.0, PERIOD, 500)])
        size = np.where(slides, 0.3, 1.0) / abs(path).max(axis=0)
        return cls(size * made.sines, size * made.cosines)

    def sample(self, t: float) -> Reference:
        """Position, velocity and acceleration."""
        w = 2.0 * np.pi / PERIOD * np.arange(1, HARMONICS + 1)
        s, c = np.sin(w * t), np.cos(w * t)
        return Reference(
            s @ self.sines + c @ self.cosines,
            (c * w) @ self.sines - (s * w) @ self.cosines,
            -(s * w**2) @ self.sines - (c * w**2) @ self.cosines,
        )


@cache
def scenes(name: str) -> tuple[Scene, Scene]:
    """An arm, and its nominal scene."""
    if name != TUTORIAL:
        nominal = LagrangeArm(LINKS[name], *np.zeros((3, len(LINKS[name]))))
        return exact_scene(true_arm(LINKS[name])), {"robot": {"urdf": nominal.urdf}}
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
    found = base_truth(RigidRegressor(nominal), theta, real.armature)
    for joint in real.joint_names:
        friction = real.scene.joint(joint).friction
        for key in ("viscous", "coulomb"):
            found[f"{joint}.{key}"] = float(np.mean(getattr(friction, key)))
    return found


def sensors(kind: str, seed: int, effort: Mapping[str, float]) -> Scene:
    """The sensors of a kind; none is exact."""
    noise = {"noise": {joint: NOISE * size for joint, size in effort.items()}}
    given: dict[str, Scene] = {
        "noisy": {"position": {"noise": 2e-5}, "velocity": {"from": "position", "cutoff": 60}},
        "quantized": {
            "position": {"resolution": STEP}, "velocity": {"from": "position", "cutoff": 60},
        },
        "filtered": {
            "position": {"resolution": 2e-5}, "velocity": {"from": "position", "cutoff": 20},
        },
    }  # fmt: skip
    given["joint_states"] = given["noisy"]
    return {} if kind == "exact" else {"sensors": {"seed": seed, "effort": noise, **given[kind]}}


@cache
def efforts(name: str) -> dict[str, float]:
    """Root mean square of each joint's effort."""
    dynamics = Dynamics(scenes(name)[0])
    motion = Fourier.of(0, slides(name))
    states = [motion.sample(t) for t in np.linspace(0.0, PERIOD, 500)]
    tau = dynamics.inverse(*(np.array([getattr(s, key) for s in states]) for key in "qva"))
    sizes = np.sqrt((tau**2).mean(axis=0)).tolist()
    return dict(zip(dynamics.joint_names, sizes, strict=True))


def slides(name: str) -> list[bool]:
    """Which joints are prismatic."""
    kinds = ArmModel(load_scene(scenes(name)[1])).joint_types
    return [kind == "prismatic" for kind in kinds]


def simulated(name: str, kind: str, seed: int) -> Recording:
    """A recording of an arm by sensors of a kind."""
    real, nominal = scenes(name)
    sim = Simulator({**real, **sensors(kind, seed, efforts(name))}, dt=DT)
    motion = Fourier.of(seed, slides(name))
    start = motion.sample(0.0)
    sim.reset(start.q, start.v)
    return sim.run(motion.duration, ComputedTorque(Dynamics(nominal), dt=DT), motion)


def through_joint_states(run: Recording) -> JointRecord:
    """What a bag of the topic ``joint_states`` says, of every so many ticks."""
    with tempfile.TemporaryDirectory() as folder:
        path = run.save(Path(folder) / "run.mcap")
        bag = Recording.load(path, topic="/joint_states")
    kept = JointRecord.from_recording(bag)
    return kept.rows(slice(None, None, PUBLISHED))


@dataclass(frozen=True)
class Outcome:
    """Of one identification.

    Attributes:
        errors: Errors of the parameters over half their interval, by name.
        scatter: Parameters whose interval is called scatter.
        found: The identification.
    """

    errors: dict[str, float]
    scatter: frozenset[str]
    found: Identification


def outcome(name: str, kind: str, seed: int) -> Outcome | None:
    """Identify an arm from one recording; None if it is refused, and why is printed."""
    run = simulated(name, kind, seed)
    record = through_joint_states(run) if kind == "joint_states" else run
    try:
        found = identify(scenes(name)[1], record, accept_worse=True)
    except InvalidInput as refused:
        print(f"  {name}, {kind}, {seed}: {refused}", flush=True)
        return None
    true, errors = truth(name), dict[str, float]()
    for parameter, (low, high) in found.intervals.items():
        half = 0.5 * max(high - low, 1e-300)
        # Friction does not fall with speed: a velocity at which it does has no true value.
        invented = parameter.endswith("stribeck_velocity")
        off = found.parameters[parameter] - true.get(parameter, 0.0)
        errors[parameter] = np.inf if invented else off / half
    return Outcome(errors, frozenset(getattr(found, "scatter", ())), found)


def summary(outcomes: list[Outcome]) -> dict[str, float]:
    """Shares of intervals that contain the truth, of all parameters and of friction."""
    errors = [(p, e, p in one.scatter) for one in outcomes for p, e in one.errors.items()]
    judged = [(p, abs(e) <= 1.0) for p, e, scatter in errors if not scatter]
    rubs = [held for p, held in judged if p.endswith(("viscous", "coulomb"))]
    everything = [abs(e) <= 1.0 for _, e, _ in errors]
    mean = lambda values: float(np.mean(values)) if values else np.nan  # noqa: E731
    return {
        "intervals": len(errors), "scatter": mean([s for *_, s in errors]),
        "held": mean([held for _, held in judged]), "held, friction": mean(rubs),
        "held, scatter too": mean(everything),
        "torque error": mean([one.found.error[0] for one in outcomes]),
    }  # fmt: skip


def tell(found: list[Outcome]) -> None:
    """Print bias and deviation of each parameter's errors, over the standard error."""
    errors = dict[str, list[tuple[float, bool]]]()
    for one in found:
        for name, error in one.errors.items():
            errors.setdefault(name, []).append((1.96 * error, name in one.scatter))
    for name, each in errors.items():
        off, scatter = np.array(each).T
        held = np.mean(abs(off) <= 1.96)
        print(f"  {name}: {len(off)}, held {held:.0%}, scatter {scatter.mean():.0%}, "
              f"bias {off.mean():.2f}, deviation {off.std():.2f}")  # fmt: skip


@click.command()
@click.option("--arm", "arms", multiple=True, type=click.Choice(NAMES), help="[default: all]")
@click.option("--kind", "kinds", multiple=True, type=click.Choice(KINDS), help="[default: all]")
@click.option("--seeds", default=12, show_default=True, help="Recordings of each arm and kind.")
@click.option("--first", default=1, show_default=True, help="The first seed.")
@click.option("--details", is_flag=True, help="Bias and deviation of each parameter.")
@click.option("--out", default=Path("reports/simulated.json"), show_default=True,
              type=click.Path(path_type=Path), help="JSON file for the results.")  # fmt: skip
def main(
    arms: tuple[str, ...],
    kinds: tuple[str, ...],
    seeds: int,
    first: int,
    details: bool,
    out: Path,
) -> None:
    """How often 95 % intervals from simulated recordings contain the truth."""
    rows, told = [], {}
    for name in arms or NAMES:
        for kind in kinds or KINDS:
            begun = time.process_time()
            tried = [outcome(name, kind, seed) for seed in range(first, first + seeds)]
            found = [one for one in tried if one is not None]
            told[f"{name}, {kind}"] = one = summary(found) | {"refused": seeds - len(found)}
            one["seconds"] = (time.process_time() - begun) / seeds
            rows.append([name, kind, *(f"{value:.3g}" for value in one.values())])
            print(rows[-1], flush=True)
            if details:
                tell(found)
    print(table(("arm", "sensors", *one), rows))
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(told, indent=1))


if __name__ == "__main__":
    main(prog_name="python -m benchmarks.identification.simulated")
