# SPDX-License-Identifier: Apache-2.0
"""Objects refuse attributes that are not theirs."""

import pickle
from collections.abc import Iterator
from dataclasses import replace
from enum import Enum
from importlib import import_module
from inspect import isclass
from operator import attrgetter
from pkgutil import resolve_name
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmError, Dynamics, InvalidInput
from arm_dynamics.control import PD, Settings
from arm_dynamics.exceptions import ELSEWHERE, NotAssignable, UnknownArgument, did_you_mean
from arm_dynamics.task_space import MassEllipsoid
from arm_dynamics.trajectory import Waypoint
from arm_sim import ClosedLoop, Simulator

PACKAGES = (
    "arm_dynamics", "arm_dynamics.client", "arm_dynamics.control", "arm_dynamics.dynamics",
    "arm_dynamics.scene", "arm_dynamics.task_space", "arm_dynamics.trajectory", "arm_sim",
    "arm_sim.derivatives", "arm_sim.export", "arm_sim.recording", "arm_sim.view",
    "arm_studies.autodiff", "arm_studies.identification", "arm_studies.optimization",
    "arm_studies.sweeps",
)  # fmt: skip
"""Packages whose objects people have in hand."""


def said(what: object, name: str) -> str:
    with pytest.raises(NotAssignable) as caught:
        setattr(what, name, 1)
    assert isinstance(caught.value, ArmError) and isinstance(caught.value, AttributeError)
    return str(caught.value)


def test_a_class_that_a_user_extends_has_what_the_user_gives_it() -> None:
    class Counting(PD):
        def __init__(self) -> None:
            super().__init__(2, 1.0, 0.1)
            self.calls = 0

    class Named(Settings):
        def __init__(self) -> None:
            super().__init__()
            self.name = "soft"

    controller, settings = Counting(), Named()
    controller.calls += 1
    assert (controller.calls, settings.name) == (1, "soft")
    assert replace(Settings(), dt=0.01) == pickle.loads(pickle.dumps(Settings(dt=0.01)))
    assert said(settings, "bandwidth").startswith("Named.bandwidth cannot be set")


@pytest.fixture(scope="module")
def held(sim: Simulator) -> list[Any]:
    """Objects that people have in hand."""
    motion = sim.run(0.002)
    return [sim, Dynamics(sim.model), sim.plan, sim.state, motion, ClosedLoop(sim.model.scene)]


OTHERS = [(name, ours) for ours, theirs in ELSEWHERE.items() for name in theirs.split()]


@pytest.mark.parametrize(("name", "ours"), OTHERS)
def test_the_names_of_other_libraries_lead_to_ours(held: list[Any], name: str, ours: str) -> None:
    assert did_you_mean(name, [], {ours: ""}) == f"; did you mean '{ours}'?"
    assert not ours.startswith("arm_") or resolve_name(ours)  # others are keys of scenes
    for what in held:
        if hasattr(what, ours) and not hasattr(what, name):
            with pytest.raises(AttributeError, match="; did you mean '") as caught:
                getattr(what, name)
            attrgetter(str(caught.value).split("'")[3])(what)  # is there


def test_an_error_of_arguments_names_what_was_called(sim: Simulator) -> None:
    scene, dynamics = models.scene("double_pendulum"), Dynamics(sim.model)
    for call, message in (
        (lambda: Simulator(scene, timestep=1), "Simulator has no argument 'timestep'; .* 'dt'"),
        (lambda: ClosedLoop(scene, bandwidth=1), r"ClosedLoop .*Settings\(bandwidth=….* import"),
        (lambda: Settings(kp=1), "Settings has no argument 'kp'; did you mean 'bandwidth'"),
        (lambda: sim.run(T=1), "Simulator.run has no argument 'T'; did you mean 'duration'"),
        (lambda: dynamics.mass_matrix(qpos=1), "Dynamics.mass_matrix .* 'qpos'; did you mean 'q'"),
    ):
        with pytest.raises(UnknownArgument, match=message) as caught:
            call()  # type: ignore[no-untyped-call]
        assert isinstance(caught.value, TypeError)


def test_objects_show_themselves_in_a_few_words(held: list[Any]) -> None:
    for what in held:
        shown = repr(what)
        assert len(shown) < 2000 and " at 0x" not in shown
    assert repr(held[0]).startswith("<Simulator of double_pendulum, 2 joints: shoulder, elbow;")
    ellipsoid = repr(MassEllipsoid(np.ones(2), np.eye(2), False))
    assert "masses=[1, 1]" in ellipsoid and "axes=array of shape (2, 2)" in ellipsoid


def test_too_many_numbers_name_the_joints_that_have_none() -> None:
    scene = models.scene("double_pendulum")
    robot = scene.robot.model_copy(update={"lock": ("elbow",)})
    locked = Simulator(scene.model_copy(update={"robot": robot}))
    for call in (locked.reset, locked.step, locked.dynamics.gravity):
        with pytest.raises(InvalidInput, match=r"has shape \(2,\).*; locked: elbow$"):
            call(np.zeros(2))
    with pytest.raises(InvalidInput, match=r"expected$"):
        locked.dynamics.gravity([])


def exported() -> Iterator[Any]:
    """Classes that packages hand out, of which there are objects."""
    for package in map(import_module, PACKAGES):
        for name in package.__all__:
            found = getattr(package, name)
            if not isclass(found) or getattr(found, "_is_protocol", False):
                continue
            if not issubclass(found, BaseException | Enum):
                yield found


def test_every_class_that_a_package_hands_out_refuses_what_is_not_its_own() -> None:
    homes = {"arm_dynamics.attributes", "arm_dynamics.scene.types"}
    free = {cls for cls in exported() if getattr(cls.__setattr__, "__module__", "") not in homes}
    assert not free


@pytest.fixture(scope="module")
def sim() -> Simulator:
    return Simulator(models.scene("double_pendulum"))


def test_what_is_built_says_how_to_change_it(sim: Simulator) -> None:
    for what, name, instead in (
        (sim, "dt", "build another Simulator(scene, dt=…, integrator=…, tolerance=…)"),
        (sim, "q", "set_state(q=…, v=…)"), (sim, "gravity", "set_parameter(name, value)"),
        (sim.state, "q", "Simulator.set_state(q=…, v=…)"), (sim.plan, "integrator", "Plan("),
        (ClosedLoop(models.scene("two_link")), "bandwidth", "Settings(bandwidth=…)"),
        (Waypoint(1.0, np.zeros(2)), "position", "did you mean 'q'"),
        (Settings(), "bandwith", "has no attribute 'bandwith'; did you mean 'bandwidth'?"),
    ):  # fmt: skip
        assert instead in said(what, name)
