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
    ComputedTorque,
    DisturbanceObserver,
    FrictionFeedForward,
    Measured,
    PDGravity,
    Saturated,
    Settings,
    Switch,
    make_controller,
)
from arm_dynamics.control.compiled_law import compiled_law
from arm_dynamics.control.custom import Watched, load_controller
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
    assert load_controller("my_file_of_here:Mine").__module__ == "my_file_of_here"
    with pytest.raises(InvalidInput, match="has no class 'Mine'"):
        load_controller("own_controllers:Mine")
    with pytest.raises(InvalidInput, match="PYTHONPATH, and the present folder"):
        load_controller("my_file_of_there:Mine")


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


def test_our_own_classes_can_be_named_too(dynamics: Dynamics) -> None:
    maker = load_controller("arm_dynamics.control:ComputedTorque")
    settings = Settings(bandwidth=12.0, damping_ratio=0.8, dt=0.002)
    named = make_controller(maker, dynamics, settings).torque(STATE, GOAL)
    direct = ComputedTorque(dynamics, 12.0, 0.8, 0.002).torque(STATE, GOAL)
    np.testing.assert_allclose(named, direct, rtol=1e-13)


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


def test_two_classes_of_one_name_do_not_share_their_code(dynamics: Dynamics) -> None:
    def softer() -> type:
        class Pull(own_controllers.Pull):
            def formula(self, *arguments: Any) -> Any:
                tau, memory = super().formula(*arguments)
                return 0.5 * tau, memory

        return Pull

    whole, half = (
        make_controller(maker, dynamics).torque(STATE, GOAL)
        for maker in (own_controllers.Pull, softer())
    )
    np.testing.assert_allclose(half, 0.5 * whole, rtol=1e-13)


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
    limit = np.array([1.0, 0.5])
    settings = Settings(limit=limit, saturate=True)
    cut = make_controller(own_controllers.Springs, dynamics, settings)
    assert isinstance(cut, Saturated) and (abs(cut.torque(STATE, GOAL)) <= limit).all()
    observed = make_controller(own_controllers.Springs, dynamics, Settings(observer=20.0))
    assert isinstance(observed, DisturbanceObserver)


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


def test_a_module_that_fails_is_refused_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "does_not_load.py").write_text("raise RuntimeError('half\\ndone')")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(
        InvalidInput, match=r"RuntimeError: half done \(line 1 of '.*/does_not_load\.py"
    ):
        load_controller("does_not_load:Class")


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
    "none": "returned shape \\(\\)",
    "text": "returned a str",
    "write reference": "raised ValueError: .*read-only",
}


@pytest.mark.parametrize("how", FAILURES)
def test_what_fails_has_failed_until_it_is_restarted(dynamics: Dynamics, how: str) -> None:
    inside = own_controllers.Fails(dynamics)
    control = Watched(inside, "Fails", 2)
    good = control.torque(STATE, GOAL)
    inside.how = how
    with pytest.raises(ControllerFailed, match=f"controller Fails {FAILURES[how]}"):
        control.torque(STATE, GOAL)
    inside.how = ""
    with pytest.raises(ControllerFailed):
        control.torque(STATE, GOAL)
    control.restart()
    np.testing.assert_array_equal(control.torque(STATE, GOAL), good)


def test_one_that_cannot_be_restarted_has_failed(dynamics: Dynamics) -> None:
    inside = own_controllers.Fails(dynamics)
    control = Watched(inside, "Fails", 2)
    inside.how = "restart"
    control.restart()
    with pytest.raises(
        ControllerFailed, match="RuntimeError: cannot begin .*own_.* when restarted"
    ):
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


@pytest.mark.parametrize(
    ("base", "settings"),
    [(own_controllers.Pull, Settings(friction=True)), (own_controllers.Springs, Settings())],
)
def test_after_a_failure_a_restart_is_enough_however_it_is_wrapped(
    dynamics: Dynamics, base: Any, settings: Settings
) -> None:
    class Failing(base):  # type: ignore[misc]
        friction_terms = "all"
        broken = False

        def __init__(self, dynamics: Dynamics):
            super().__init__(dynamics)

        def torque(self, state: Any, reference: Any) -> Any:
            if self.broken:
                raise OSError("sensor lost")
            return np.array(super().torque(state, reference)) + 1.0  # so it stays uncompiled

    control = make_controller(Failing, dynamics, settings)
    good = control.torque(STATE, GOAL)
    Failing.broken = True
    with pytest.raises(ControllerFailed, match="sensor lost"):
        control.torque(STATE, GOAL)
    Failing.broken = False
    with pytest.raises(ControllerFailed):
        control.torque(STATE, GOAL)
    Switch(control, dt=1e-3).restart()
    np.testing.assert_array_equal(control.torque(STATE, GOAL), good)


def test_its_own_restart_decides_what_it_remembers(dynamics: Dynamics) -> None:
    class Warm(own_controllers.Pull):
        def restart(self) -> None:
            self.memory = (np.full(self._n, 7.0),)

    control, direct = make_controller(Warm, dynamics), Warm(dynamics)
    for _ in range(2):
        np.testing.assert_allclose(
            control.torque(STATE, GOAL), direct.torque(STATE, GOAL), rtol=1e-12
        )
        control.restart()
        direct.restart()
    assert compiled_law(control) is not None


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
