# SPDX-License-Identifier: Apache-2.0
"""User-defined controllers: found by name, built with their arguments, and supervised."""

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import own_controllers
import pytest

import models
from arm_dynamics import Dynamics, InvalidInput
from arm_dynamics.control import (
    DisturbanceObserver,
    FrictionFeedForward,
    Measured,
    PDGravity,
    Settings,
    Switch,
    make_controller,
)
from arm_dynamics.control.compiled_law import compiled_law
from arm_dynamics.control.custom import load_controller
from arm_dynamics.exceptions import ControllerFailed
from arm_dynamics.trajectory import Reference


@pytest.fixture
def dynamics() -> Dynamics:
    return models.dynamics("two_link")


STATE = Measured(np.array([0.3, -0.2]), np.array([0.1, 0.4]))
GOAL = Reference(np.array([0.5, 0.1]), np.zeros(2), np.zeros(2))


def test_a_file_of_the_present_folder_is_found_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])
    monkeypatch.chdir(tmp_path)
    for name in ("my_file_of_here", "own_controllers"):
        (tmp_path / f"{name}.py").write_text("class Mine:\n    torque = None\n")
    (tmp_path / "does_not_load.py").write_text("raise RuntimeError('half\\ndone')")
    assert load_controller("my_file_of_here:Mine").__module__ == "my_file_of_here"
    with pytest.raises(InvalidInput, match="has no class 'Mine'"):
        load_controller("own_controllers:Mine")
    with pytest.raises(InvalidInput, match="PYTHONPATH, and the present folder"):
        load_controller("my_file_of_there:Mine")
    with pytest.raises(InvalidInput, match=r"half done \(line 1 of '.*/does_not_load\.py"):
        load_controller("does_not_load:Class")


def test_a_class_gets_what_it_asks_for(dynamics: Dynamics) -> None:
    settings = Settings(dt=0.002, limit=[5.0, 6.0])
    expected = own_controllers.Everything(dynamics, settings, dt=0.002, limit=settings.limit)
    made: list[Any] = []

    class Noted(own_controllers.Everything):
        def __init__(self, dynamics: Dynamics, settings: Settings, *, dt: float, limit: Any = 0):
            super().__init__(dynamics, settings, dt=dt, limit=limit)
            made.append(self.given)

    make_controller(Noted, dynamics, settings)
    assert made == [expected.given]


def test_one_with_a_formula_is_compiled_as_ours_are(dynamics: Dynamics) -> None:
    limit = np.array([30.0, 20.0])
    settings = Settings(friction=True, observer=20.0, saturate=True, limit=limit)
    control = make_controller(own_controllers.Pull, dynamics, settings)
    law = compiled_law(control)
    assert law is not None and law.limit is not None
    plain = FrictionFeedForward(own_controllers.Pull(dynamics), dynamics.model)
    direct = DisturbanceObserver(plain, dynamics, settings.dt, 20.0, limit)
    for _ in range(3):  # they remember
        expected = np.clip(direct.torque(STATE, GOAL), -limit, limit)
        np.testing.assert_allclose(control.torque(STATE, GOAL), expected, rtol=1e-12)


def test_a_formula_may_use_functions_of_numpy(dynamics: Dynamics) -> None:
    class Bounded(own_controllers.Pull):
        def formula(self, rigid: Any, q: Any, v: Any, goal: Any, tuning: Any, memory: Any) -> Any:
            return rigid.gravity(q) + 5.0 * np.tanh(tuning[0] * (goal.q - q)), memory

    control = make_controller(Bounded, dynamics)
    assert compiled_law(control) is not None
    expected = Bounded(dynamics).torque(STATE, GOAL)
    np.testing.assert_allclose(control.torque(STATE, GOAL), expected, rtol=1e-12)


@pytest.mark.parametrize("maker", [own_controllers.Numbers, own_controllers.Other])
def test_one_whose_formula_is_no_expression_or_another_runs_uncompiled(
    dynamics: Dynamics, maker: Any, caplog: pytest.LogCaptureFixture
) -> None:
    control = make_controller(maker, dynamics)
    expected = maker(dynamics).torque(STATE, GOAL)
    np.testing.assert_array_equal(control.torque(STATE, GOAL), expected)
    assert compiled_law(control) is None
    assert "continues without compiled code" in caplog.text
    assert maker.__name__ in caplog.text and "Pinocchio" not in caplog.text


def test_friction_is_added_or_refused(dynamics: Dynamics) -> None:
    wish = Settings(friction=True)
    with pytest.raises(InvalidInput, match="Springs does not say which friction it leaves out"):
        make_controller(own_controllers.Springs, dynamics, wish)
    make_controller(own_controllers.Everything, dynamics, wish)  # which gets the settings
    wrong = type("Wrong", (own_controllers.Pull,), {"friction_terms": "wet"})
    with pytest.raises(InvalidInput, match="Wrong: friction_terms = 'wet'; allowed: 'all', 'dry'"):
        make_controller(wrong, dynamics, wish)


def test_its_torques_get_through_and_it_is_wrapped_as_ours_are(dynamics: Dynamics) -> None:
    tau = make_controller(own_controllers.Springs, dynamics).torque(STATE, GOAL)
    expected = PDGravity(dynamics, 400.0, 40.0).torque(STATE, GOAL)
    np.testing.assert_allclose(tau, expected, rtol=1e-12)
    settings = Settings(limit=[1.0, 0.5], saturate=True)
    cut = make_controller(own_controllers.Springs, dynamics, settings)
    assert (abs(cut.torque(STATE, GOAL)) <= settings.limit).all()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("no_such_module:Class", "importing 'no_such_module' failed with ModuleNotFoundError"),
        ("own_controllers:Spring", "has no class 'Spring'; it has .*Springs"),
        ("own_controllers:Springs()", "expected the form package.module:Class"),
    ],
)
def test_what_cannot_be_found_is_refused_by_name(name: str, said: str) -> None:
    with pytest.raises(InvalidInput) as error:
        load_controller(name)
    assert name in str(error.value) and re.search(said, str(error.value))


@pytest.mark.parametrize(
    ("maker", "said"),
    [
        (own_controllers.NeedsMore, "controller NeedsMore needs camera; .*bandwidth.*dynamics"),
        (own_controllers.Broken, "Broken cannot be made: OSError: no calibration file"),
        (own_controllers.NoTorque, "NoTorque is of type NoTorque, which has no method torque"),
    ],
)
def test_what_cannot_be_made_is_refused_by_name(dynamics: Dynamics, maker: Any, said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        make_controller(maker, dynamics)


FAILURES = {
    "raise": r"raised ZeroDivisionError: oh oh oh .*… \(line \d+ of '.*/own_controllers.py'\)$",
    "nan": "returned \\[ *nan",
    "shape": "returned shape \\(1,\\)",
    "text": "returned a str",
    "write reference": "raised ValueError: .*read-only",
}


@pytest.mark.parametrize("how", FAILURES)
def test_what_fails_has_failed_until_it_is_restarted(
    dynamics: Dynamics, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    """However it is wrapped."""
    control = make_controller(own_controllers.Fails, dynamics, Settings(observer=20.0))
    good = control.torque(STATE, GOAL)
    monkeypatch.setattr(own_controllers.Fails, "how", how)
    with pytest.raises(ControllerFailed, match=f"controller Fails {FAILURES[how]}"):
        control.torque(STATE, GOAL)
    monkeypatch.setattr(own_controllers.Fails, "how", "")
    with pytest.raises(ControllerFailed):
        control.torque(STATE, GOAL)
    Switch(control, dt=1e-3).restart()
    np.testing.assert_array_equal(control.torque(STATE, GOAL), good)


def test_one_that_cannot_be_restarted_has_failed(
    dynamics: Dynamics, monkeypatch: pytest.MonkeyPatch
) -> None:
    control = make_controller(own_controllers.Fails, dynamics)
    monkeypatch.setattr(own_controllers.Fails, "how", "restart")
    control.restart()
    with pytest.raises(ControllerFailed, match="RuntimeError: cannot begin .* when restarted"):
        control.torque(STATE, GOAL)


class Constant(own_controllers.Pull):
    """A number of its formula is neither in ``tuning`` nor in ``key``."""

    def __init__(self, dynamics: Dynamics, factor: float):
        super().__init__(dynamics)
        self.factor = factor

    def formula(self, *arguments: Any) -> Any:
        tau, memory = super().formula(*arguments)
        return self.factor * tau, memory


def test_one_that_differs_from_the_code_of_its_class_is_not_answered_by_it(
    dynamics: Dynamics, caplog: pytest.LogCaptureFixture
) -> None:
    once, thrice = (
        make_controller(lambda dynamics, k=factor: Constant(dynamics, k), dynamics)
        for factor in (1.0, 3.0)
    )
    tau = once.torque(STATE, GOAL)
    np.testing.assert_allclose(thrice.torque(STATE, GOAL), 3.0 * tau, rtol=1e-12)
    assert compiled_law(once) is not None and compiled_law(thrice) is None
    assert "differs from the controller's torque" in caplog.text


def test_a_memory_that_is_changed_in_place_is_reset(dynamics: Dynamics) -> None:
    class Adds(own_controllers.Numbers):
        restart = None  # what it remembers is put back for it

        def formula(self, rigid: Any, q: Any, v: Any, goal: Any, _: Any, memory: Any) -> Any:
            memory[0][:] += np.array(goal.q - q, dtype=float)
            return 1.0 * memory[0], memory

    control = make_controller(Adds, dynamics)
    first = control.torque(STATE, GOAL)
    assert (control.torque(STATE, GOAL) != first).all()
    control.restart()
    np.testing.assert_array_equal(control.torque(STATE, GOAL), first)


def test_a_failure_in_a_posture_of_the_comparison_is_none_on_the_arm(dynamics: Dynamics) -> None:
    class Careful(own_controllers.Pull):
        def torque(self, state: Any, reference: Any) -> Any:
            if not np.array_equal(state.q, STATE.q):
                raise ValueError("out of range")
            return super().torque(state, reference)

    expected = Careful(dynamics).torque(STATE, GOAL)
    np.testing.assert_array_equal(make_controller(Careful, dynamics).torque(STATE, GOAL), expected)
