# SPDX-License-Identifier: Apache-2.0
"""Compiled answers at one state: those of Pinocchio, refusals included."""

import gc
import sysconfig
import weakref
from collections.abc import Callable
from functools import cache
from itertools import product
from typing import Any

import casadi as ca
import numpy as np
import pytest
from samples import always, sampled

import models
from arm_dynamics import ArmError, Dynamics, InvalidInput, KernelError, Term
from arm_dynamics.codegen import Kernel, compiler, python_call
from models.asked import CALLS, LAWS
from tolerances import ALGEBRA, assert_close

Call = Callable[..., Any]


@cache
def compiled(name: str) -> Dynamics:
    plain = models.dynamics(name)
    return plain.compiled(plain.model.frame_names[-1])


@cache
def with_law(name: str) -> Dynamics:
    scene = models.scene("two_link").model_dump(exclude_unset=True)
    return Dynamics({**scene, "joints": {"*": LAWS[name]}})


@pytest.mark.parametrize("robot", sampled(models.ROBOTS, 4))
def test_equals_pinocchio(
    robot: str, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And is compiled: calls that reach the numeric dynamics fail."""
    plain, own = models.dynamics(robot), compiled(robot)
    for what, _ in product(CALLS, range(3)):
        state = models.random_state(rng, plain.n)
        wanted = CALLS[what](plain, *state)
        with monkeypatch.context() as patch:
            patch.setattr("arm_dynamics.dynamics.dynamics.vectors", None)
            made = CALLS[what](own, *state)
        assert made.shape == wanted.shape, what
        if what == "forward":  # in torques, for M⁻¹ may be large
            M = plain.mass_matrix(state[0])
            scale = abs(M) @ abs(wanted) + abs(state[2])
            assert abs(M @ (made - wanted)).max() < ALGEBRA * scale.max()
        else:
            assert_close(made, wanted, ALGEBRA)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    "what", always(["inverse", "forward", "friction", "energy", "gravity"], "inverse", "forward")
)
def test_friction_drives_and_springs(law: str, what: str, rng: np.random.Generator) -> None:
    plain = with_law(law)
    own = plain.compiled()
    for at_rest in (False, True):
        q, v, x = models.random_state(rng, plain.n)
        v[at_rest] = 0.0 if at_rest else v[0]
        assert_close(CALLS[what](own, q, v, x), CALLS[what](plain, q, v, x), ALGEBRA)


@pytest.mark.parametrize("what", CALLS)
def test_however_numbers_are_given(what: str, rng: np.random.Generator) -> None:
    """Lists, rows of small batches and arrays with gaps: the same bits."""
    own = compiled("two_link")
    states = rng.normal(size=(3, 4, 2))
    wanted = [CALLS[what](own, *state) for state in states.swapaxes(0, 1)]
    lists = [CALLS[what](own, *state.tolist()) for state in states.swapaxes(0, 1)]
    gaps = np.repeat(states, 2, axis=2)[..., ::2]
    np.testing.assert_array_equal(lists, wanted)
    np.testing.assert_array_equal(CALLS[what](own, *states), wanted)
    np.testing.assert_array_equal(
        [CALLS[what](own, *state) for state in gaps.swapaxes(0, 1)], wanted
    )


def test_other_terms_and_frames_are_pinocchios(rng: np.random.Generator) -> None:
    own, plain = compiled("panda"), models.dynamics("panda")
    q, v, a = models.random_state(rng, 7)
    for terms in (Term.GRAVITY, Term.ALL ^ Term.FRICTION, 0):
        np.testing.assert_array_equal(own.inverse(q, v, a, terms), plain.inverse(q, v, a, terms))
    np.testing.assert_array_equal(own.inverse(q, v, a, 31), own.inverse(q, v, a))
    np.testing.assert_array_equal(own.pose(q, "panda_link4"), plain.pose(q, "panda_link4"))


def test_constraints_are_enforced(rng: np.random.Generator) -> None:
    plain = models.dynamics("four_bar")
    q, v, tau = plain.model.q0, np.zeros(plain.n), rng.normal(size=plain.n)
    np.testing.assert_array_equal(plain.compiled().forward(q, v, tau), plain.forward(q, v, tau))


def test_external_torques_act(rng: np.random.Generator) -> None:
    state = models.random_state(rng, 2)
    pushed, expected = (
        dynamics.under([3.0, -1.0])
        for dynamics in (compiled("two_link"), models.dynamics("two_link"))
    )
    for what, own in product(("inverse", "forward"), (pushed, expected.compiled())):
        made = CALLS[what](own, *state)
        np.testing.assert_array_equal(made, CALLS[what](expected, *state))
        assert abs(made - CALLS[what](compiled("two_link"), *state)).min() > 0.1


WRONG = {
    "one too many": np.zeros(3), "none": np.zeros(0), "a number": np.float64(1.0),
    "a cube": np.zeros((2, 2, 2)), "not a number": np.array([0.0, np.nan]),
    "infinite": np.array([-np.inf, 0.0]), "text": "ab", "truth": [True, False],
    "complex": np.zeros(2, complex), "objects": np.array([None, 1.0]), "nothing": None,
}  # fmt: skip


def answer(call: Call, dynamics: Dynamics, *given: Any) -> tuple[type, str] | None:
    """The error of a call, if there is one."""
    try:
        call(dynamics, *given)
    except ArmError as error:
        return type(error), str(error)
    return None


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_refuses_the_same_with_the_same_words(wrong: Any) -> None:
    refused = 0
    for (what, call), place in product(CALLS.items(), range(3)):
        given: list[Any] = [np.zeros(2)] * 3
        given[place] = wrong
        own = answer(call, compiled("two_link"), *given)
        assert own == answer(call, models.dynamics("two_link"), *given), (what, place)
        refused += own is not None
    assert refused >= len(CALLS)


def test_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiler, "find_compiler", lambda language="c": None)
    with pytest.raises(KernelError, match="no C compiler found"):
        models.dynamics("two_link").compiled()


def test_without_the_headers_of_python(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(tmp_path))
    python_call.python_function.cache_clear()
    with pytest.raises(KernelError, match=r"need Python's headers, .* apt install python3-dev"):
        models.dynamics("two_link").compiled()
    python_call.python_function.cache_clear()


def test_memory_lives_as_long_as_the_function() -> None:
    x = ca.SX.sym("x", 2)
    kernel = Kernel([ca.Function("twice", [x], [2 * x])], "native")
    call, there = python_call.python_call(kernel, "twice", (2,)), weakref.ref(kernel)
    del kernel
    gc.collect()
    np.testing.assert_array_equal(call(np.array([1.0, 2.0])), [2.0, 4.0])
    del call
    gc.collect()
    assert there() is None


@pytest.mark.filterwarnings("ignore:(overflow|invalid value) encountered:RuntimeWarning")
def test_no_answer_overflows_silently() -> None:
    """A number that is not finite is not an answer, whichever code computes it."""
    q, fast, none = [0.0, 1.0], [1e200, 0.0], [0.0, 0.0]
    for dynamics, call in product(
        (models.dynamics("two_link"), compiled("two_link")),
        (
            lambda d: d.inverse(q, fast, none),
            lambda d: d.inverse([q] * 300, fast, none),
            lambda d: d.command(q, fast, none),
            lambda d: d.energy(q, fast),
            lambda d: d.constrained_forward(q, fast, none),
        ),
    ):
        with pytest.raises(InvalidInput, match="the numbers given are too large"):
            call(dynamics)


def test_an_unknown_frame_is_refused() -> None:
    with pytest.raises(InvalidInput, match="^frame 'paw' does not exist; allowed: "):
        models.dynamics("two_link").compiled(["tip", "paw"])
    with pytest.raises(InvalidInput, match="does not exist; allowed: "):
        compiled("two_link").pose(np.zeros(2), "paw")
