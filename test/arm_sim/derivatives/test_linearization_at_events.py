# SPDX-License-Identifier: Apache-2.0
"""Derivatives of ticks with events: against differences of ticks, closed forms, and refusals."""

from collections.abc import Callable
from functools import cache
from itertools import cycle, product
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from samples import always, covering

import models
from arm_dynamics.exceptions import CompilerMissing
from arm_sim import NotDifferentiable, Simulator
from arm_sim.derivatives import eventful_ticks, tangents
from models.driven import wheel
from models.touching import carrier, contact, rails, unbalance
from tolerances import ALGEBRA, CLOSED_FORM, assert_close

ACROSS = 1e-6
"""Derivatives of a tick with events against extrapolated differences, relative."""

OPTIONS: dict[str, dict[str, Any]] = {
    "rk4": {"integrator": "rk4"},
    "nystrom4": {"integrator": "nystrom4"},
    "euler": {"integrator": "euler"},
    "error control": {"tolerance": 1e-12},
}
PLANAR = (models.FOLDER / "planar_3r.urdf").read_text()
G = 9.81


def rail(friction: Any = None, stop: Any = False) -> dict[str, Any]:
    """A mass of 2 kg on a vertical rail, with a stop at zero if one is given."""
    scene = rails("z", mass=2.0)
    limits = {"lower": 0.0, "upper": 2.0, "stop": stop}
    scene["joints"] = {"z": {"limits": limits, **({"friction": friction} if friction else {})}}
    return scene


def planar(stop: Any, friction: Any, **scene: Any) -> dict[str, Any]:
    """Three links in a vertical plane; joints as said."""
    limits = {"lower": -1.0, "upper": 1.0, "stop": stop}
    return {
        "robot": {"urdf": PLANAR},
        "joints": {"*": {"friction": friction, "limits": limits}},
    } | scene


def touching(scene: dict[str, Any], **settings: Any) -> dict[str, Any]:
    return scene | {"constraints": [contact("body", **settings)]}


def spinning(**settings: Any) -> dict[str, Any]:
    """A base on a table, free along x and z, with an unbalanced rotor about y; no weight."""
    scene = rails("xz", branches=[unbalance("0 -1 0", 0.5, 0.2)])
    return touching(scene | {"gravity": [0, 0, 0]}, **settings)


def tied() -> dict[str, Any]:
    """A body on rails x and z and a weight that drops as the body goes along x, by a cord.

    Joints are drive, upwards, x, z.
    """
    weight = carrier("prismatic", "z", 2.0)
    cord = {"type": "coupling", "name": "cord", "joints": ["x", "drive"], "ratio": -1.0}
    dry = {"*": {"friction": {"coulomb": 1.0, "static": 2.0}}}
    scene = {"constraints": [cord], "joints": dry, "gravity": [0, 0, -0.5]}
    return rails("xz", 2.0, branches=[weight]) | scene


def flexible() -> dict[str, Any]:
    scene: dict[str, Any] = wheel(
        0.1, {"stiffness": 500.0, "damping": 0.3},
        command="torque", gear_ratio=20.0, rotor_inertia=5e-5,
    )  # fmt: skip
    scene["joints"]["axle"]["limits"] = {"lower": -1, "upper": 1, "stop": {"restitution": 0.4}}
    return scene


@cache
def simulator(build: Callable[[], dict[str, Any]], dt: float, name: str) -> Simulator:
    return Simulator(build(), dt=dt, **OPTIONS[name])


def compare(
    sim: Simulator, q: Any, v: Any, tau: Any, ticks: int = 1, free: Any = None, h: float = 1e-5
) -> None:
    """A and B against central differences, extrapolated; ``free``: columns of x that may vary."""
    tau, start = np.array(tau, dtype=float), sim.reset(q, v)
    x, n = np.concatenate([start.q, start.v, start.z]), sim.n
    A, B = sim.linearize(start, tau, ticks)
    ways = np.eye(len(x)) if free is None else np.array(free, dtype=float).T

    def after(dx: np.ndarray, du: np.ndarray) -> np.ndarray:
        sim.reset(*np.split(x + dx, (n, 2 * n)))
        for _ in range(ticks):
            end = sim.step(tau + du)
        return np.concatenate([end.q, end.v, end.z])

    def slope(dx: np.ndarray, du: np.ndarray) -> np.ndarray:
        coarse, fine = (
            (after(s * dx, s * du) - after(-s * dx, -s * du)) / (2 * s) for s in (h, h / 2)
        )
        return np.asarray((4 * fine - coarse) / 3)

    by_x = [slope(way, np.zeros(n)) for way in ways.T]
    by_u = [slope(np.zeros(len(x)), push) for push in np.eye(n)]
    wanted = np.column_stack([*by_x, *by_u])
    assert_close(np.column_stack([A @ ways, B]), wanted, ACROSS)


def jamming() -> dict[str, Any]:
    """A pendulum that strikes a rough plane obliquely: its full rebound would add energy."""
    plane = {"point": [np.sin(0.5), 0, -np.cos(0.5)], "normal": [np.cos(1.1), 0, np.sin(1.1)]}
    wall = contact("bob", point=[0, 0, -1], friction=3.0, restitution=0.2, plane=plane)
    return models.scene("pendulum").model_dump(exclude_unset=True) | {"constraints": [wall]}


def rebounding() -> dict[str, Any]:
    return rail(stop={"restitution": 0.6})


def compliant() -> dict[str, Any]:
    return rail(stop={"stiffness": 3000, "damping": 5})


RAIL = ([0.05], [-1.0], [1.0])
CASES: dict[str, tuple[Callable[[], dict[str, Any]], float, Any]] = {
    "lands": (lambda: rail(stop={}), 0.1, RAIL),
    "rebounds": (rebounding, 0.1, RAIL),
    "meets a compliant stop": (compliant, 0.1, RAIL),
    "rebounds above": (rebounding, 0.1, ([1.95], [1.0], [1.0])),
    "loses a compliant stop above": (compliant, 0.1, ([2.01], [-1.0], [1.0])),
    "comes to rest": (
        lambda: rail({"coulomb": 30, "static": 40, "viscous": 0.3}), 0.1, ([0.5], [0.3], [3.0])
    ),
    "turns back": (
        lambda: rail({"coulomb": 5, "static": 10, "viscous": 0.3}), 0.1, ([0.5], [0.3], [-3.0])
    ),
    "arm comes to rest and strikes": (
        lambda: planar({"restitution": 0.3}, {"coulomb": 0.5, "static": 0.8, "viscous": 0.1}),
        0.01, ([0.3, 0.992, -0.2], [0.5, 2.0, 0.05], [0.1, 0.2, 0.0]),
    ),
    "bounces on a rough table": (
        lambda: touching(rails("xyz"), friction=0.3, restitution=0.5), 0.02,
        ([0.0, 0.0, 0.005], [1.0, 0.4, -0.5], [0.3, 0.1, 0.2]),
    ),
    "lands and sticks": (
        lambda: touching(rails("xyz"), friction=3.0), 0.02,
        ([0.0, 0.0, 0.005], [1.0, 0.4, -0.5], [0.3, 0.1, 0.2]),
    ),
    "ball on an arm lands and slides": (
        lambda: touching(
            rails("xz", turns=True), point=[0.1, 0, 0], radius=0.1, friction=0.3,
            plane={"point": [0, 0, -0.5]},
        ),
        0.02, ([0.0, -0.365, 0.3], [1.0, -0.5, 0.4], [0.3, 0.1, 0.2]),
    ),
}  # fmt: skip


# Cases of one scene share a method, and so what is compiled; every method has scenes.
METHOD_OF = dict(zip(dict.fromkeys(build for build, *_ in CASES.values()), cycle(OPTIONS)))


@pytest.mark.parametrize(
    ("name", "method"),
    always(
        product(CASES, OPTIONS), *((name, METHOD_OF[build]) for name, (build, *_) in CASES.items())
    ),
)
def test_ticks_with_events_against_differences(name: str, method: str) -> None:
    build, dt, state = CASES[name]
    compare(simulator(build, dt, method), *state)


KEPT: dict[str, tuple[Callable[[], dict[str, Any]], float, Any, Any]] = {
    "slides to rest and back": (
        lambda: touching(rails("xz"), friction=0.3), 0.02,
        ([0, 0], [0.03, 0], [-5, 0.1]), np.eye(4)[[0, 2]],
    ),
    "lifts off": (
        spinning, 0.02, ([0, 0, 0.6], [0, 0, 10], [0, -6, 0]), np.eye(6)[[0, 2, 3, 5]],
    ),
    "slips": (
        lambda: spinning(friction=0.45), 0.02,
        ([0, 0, 2.1], [0, 0, 10], [0, -20, 0]), np.eye(6)[[0, 2, 5]],
    ),
    "loop with friction comes to rest": (
        tied, 0.02, ([0, 0, 0.3], [-0.003, 0.003, 0.2], [0, 0, 0]),
        [[-1, 1, 0, 0, 0, 0], [0, 0, 0, -1, 1, 0], [0, 0, 1, 0, 0, 0], [0, 0, 0, 0, 0, 1]],
    ),
}  # fmt: skip


@pytest.mark.parametrize(("name", "method"), covering(KEPT, ["rk4", "error control"]))
def test_along_what_holds_against_differences(name: str, method: str) -> None:
    """Only changes that keep contacts closed and loops obeyed can be tried from both sides."""
    build, dt, state, free = KEPT[name]
    compare(simulator(build, dt, method), *state, free=free, h=1e-4)


TUNABLE: dict[str, tuple[str, ...]] = {
    "comes to rest": ("gravity", "friction", "external"),
    "ball on an arm lands and slides": ("gravity", "payload"),
    "lifts off": ("gravity", "payload"),
}


@pytest.mark.parametrize("name", TUNABLE)
def test_by_tunable_quantities_across_events(name: str) -> None:
    """Loads change blows, instants and forces; gravity and friction the instants."""
    build, dt, (q, v, tau), *_ = (CASES | KEPT)[name]
    load = {"mass": 0.4, "com": [0.01, 0.02, 0.03], "inertia": [3e-3, 0, 0, 3e-3, 0, 3e-3]}
    scene = build() | {"tunable": list(TUNABLE[name])}
    if "payload" in TUNABLE[name]:
        scene["payloads"] = [load | {"frame": "body"}]
    sim, h = Simulator(scene, dt=dt, integrator="rk4"), 1e-5
    state = sim.reset(q, v)
    *_, P = sim.linearize(state, tau, by=TUNABLE[name])
    for quantity in TUNABLE[name]:
        nominal = sim.arm.plant.parameters.of(quantity, sim.arm.parameters).copy()

        def after(change: np.ndarray, quantity: str = quantity, at: Any = nominal) -> np.ndarray:
            sim.reset(q, v)
            sim.set_parameter(quantity, at + change)
            end = np.r_[sim.step(tau).q, sim.state.v]
            sim.set_parameter(quantity, at)
            return end

        wanted = np.column_stack([
            (8 * (after(e) - after(-e)) - (after(2 * e) - after(-2 * e))) / (12 * h)
            for e in h * np.eye(nominal.size)
        ])  # fmt: skip
        assert np.abs(wanted).max() > 1e-6
        assert_close(P[quantity], wanted, 1e-9)


def test_several_ticks() -> None:
    compare(simulator(rebounding, 0.1, "rk4"), [0.3], [-1.0], [1.0], ticks=4)


def test_link_behind_a_flexible_drive_strikes_its_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    sim = simulator(flexible, 0.02, "error control")
    compare(sim, [0.99], [1.0], [0.1])
    assert sim.impacts == 1
    monkeypatch.setattr(eventful_ticks, "MAX_STEPS", 1)
    with pytest.raises(NotDifferentiable, match="more than .* sub-steps"):
        Simulator(flexible(), dt=0.02, tolerance=1e-12).linearize(sim.reset([0.99], [1.0]), [0.1])


def test_an_interrupt_in_a_step_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps under error control are propagated in Python, called by C."""
    sim = simulator(flexible, 0.02, "error control")
    monkeypatch.setattr(tangents.Tangents, "step", Mock(side_effect=KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        sim.linearize(sim.reset([0.99], [1.0]), [0.1])


def test_a_step_too_long_to_be_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """CasADi evaluates it then, within the compiled code of the events."""
    build, dt, (q, v, tau) = CASES["bounces on a rough table"]
    wanted = simulator(build, dt, "rk4").linearize(simulator(build, dt, "rk4").reset(q, v), tau)
    monkeypatch.setattr(tangents.functions, "MAX_OPERATIONS", 0)
    sim = Simulator(build(), dt=dt, integrator="rk4")
    for found, expected in zip(sim.linearize(sim.reset(q, v), tau), wanted, strict=True):
        assert_close(found, expected, ALGEBRA)


def test_without_compiled_code_events_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    sim = Simulator(CASES["rebounds"][0](), dt=0.1)
    monkeypatch.setattr(eventful_ticks, "compile_lanes", lambda *_: None)
    with pytest.raises(CompilerMissing, match=r"events need compiled code.*\./arm build"):
        sim.linearize(sim.reset([0.05], [-1.0]), [1.0])


def test_a_stuck_joint_stays_and_passes_its_momentum_on() -> None:
    """A speed given to it is lost at once, with an impulse on the other joints."""
    friction = {"coulomb": 0.5, "static": 0.8, "viscous": 0.1}
    sim = Simulator(planar(False, friction, gravity=[0, 0, 0]), dt=0.02)
    q, v = [0.3, 0.5, -0.2], [0.5, 0.6, 0.0]
    compare(sim, q, v, [0.1, 0.2, 0.0], h=1e-6)
    A, B = sim.linearize(sim.reset(q, v), [0.1, 0.2, 0.0])
    np.testing.assert_array_equal(A[5], np.zeros(6))
    np.testing.assert_array_equal(B[:, 2], np.zeros(6))
    assert abs(A[:2, 5]).min() > 1e-4


def test_a_push_at_a_stop_goes_on_only_away_from_it() -> None:
    """Friction bears a load between its sliding and its static level, as the stop might."""
    sim = Simulator(rail(STUCK, {}) | {"gravity": [0, 0, 0]}, dt=0.1, integrator="rk4")
    start = sim.reset([2.0], [0.0])
    A, B = sim.linearize(start, [1.2])
    np.testing.assert_array_equal(A, [[1.0, 0.0], [0.0, 0.0]])
    assert not B.any()
    with pytest.raises(NotDifferentiable, match="go on"):
        sim.linearize(start, [-1.2])


def test_teeth_at_rest_within_their_backlash_touch_nothing() -> None:
    """Motor and link move freely there; at a flank they do so on one side only."""
    scene = wheel(
        0.1, {"stiffness": 500.0, "damping": 0.3, "backlash": 0.01},
        command="torque", gear_ratio=20.0, rotor_inertia=5e-5,
    )  # fmt: skip
    sim, h = Simulator(scene, dt=1e-3, integrator="rk4"), 1e-3
    free = np.kron(np.eye(2), [[1.0, h], [0.0, 1.0]])
    for place, speed in ((0.001, 0.0), (-0.004, 0.1)):
        A, B = sim.linearize(sim.reset([0.0], [speed], [place, speed]), [0.0])
        assert_close(A, free, CLOSED_FORM)
        assert_close(B, [[0.0], [0.0], [h**2 / (2 * 0.02)], [h / 0.02]], CLOSED_FORM)
    with pytest.raises(NotDifferentiable, match="backlash or load of the drive of joint 'axle'"):
        sim.linearize(sim.reset([0.0], [0.0], [0.005, 0.0]), [0.0])


H = 0.1
STUCK = {"coulomb": 1.0, "static": 1.5}
GRIP = {"friction": 0.3, "static_friction": 0.5}  # a body of 1 kg slides at 2.94 N, if it slides
REFUSED: dict[str, tuple[dict[str, Any], Any, Any, Any, str]] = {
    "grazed": (rail(stop={}), [0.00125], [-0.05 * (1 + 1e-10)], [2 * (G + 1)], "grazed"),
    "hit at the beginning": (rail(stop={}), [0.0], [-1.0], [0.0], "begins with an impact"),
    "hit at the end": (rail(stop={}), [H], [-1.0], [2 * G], "end"),
    "at a compliant stop": (rail(stop={"stiffness": 1e3}), [0.0], [1.0], [0.0], "beginning"),
    "both at once": (
        rails("xz") | {"gravity": [0, 0, 0], "joints": {
            name: {"limits": {"lower": 0.0, "upper": 1.0}} for name in "xz"}},
        [0.05, 0.05], [-1.0, -1.0], [-1.0, -1.0], "same instant",
    ),
    "piles up": (rail(stop={"restitution": 0.99}), [1e-8], [0.0], [0.0], "accumulate"),
    "jams": (jamming(), [0.55], [-1.0], [0.0], "adds no energy"),
    "straight on": (
        touching(rails("xyz"), **GRIP), [0, 0, 0], [0.03, 0.01, 0], [0, 0, 0],
        "direction of sliding is not differentiable",
    ),
    "turns until it rests": (
        touching(rails("xyz"), friction=0.3), [0, 0, 0], [0.03, 0.01, 0], [0.3, 0.6, 0.1],
        "comes to rest in a straight line",
    ),
    "would slip on": (
        touching(rails("xyz"), **GRIP), [0, 0, 0], [0, 0, 0], [-2, -2.5, 0], "go on",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refuses_where_there_is_no_derivative(name: str) -> None:
    scene, q, v, tau, why = REFUSED[name]
    sim = Simulator(scene, dt=H, integrator="rk4")
    with pytest.raises(NotDifferentiable, match=why):
        sim.linearize(sim.reset(q, v), tau)


def test_without_a_compiler_a_joint_at_its_stop_is_refused() -> None:
    sim = Simulator(rail(stop={}), backend="vm")
    with pytest.raises(NotDifferentiable, match="compiled"):
        sim.linearize(sim.reset([0.0], [0.0]), [0.0])
