# SPDX-License-Identifier: Apache-2.0
"""Large batches run in compiled code: the same answers as Pinocchio's, point by point."""

import logging
from collections.abc import Callable
from functools import cache
from itertools import cycle, product

import numpy as np
import pytest
from samples import always

import models
from arm_dynamics import Dynamics, InvalidInput, ModelError, Term, load_scene
from arm_dynamics.codegen import compiler
from arm_dynamics.equations.forward_dynamics import DENSE_AT_MOST
from arm_dynamics.terms.evaluator import MANY
from models.asked import CALLS, LAWS
from models.random_tree import random_tree
from tolerances import ALGEBRA, INVERSE_PAIR, assert_close

TERMS = (Term.ALL, Term.INERTIA, Term.CORIOLIS, Term.GRAVITY, Term.INERTIA | Term.GRAVITY, 0)
ROWS = 20  # compared with single calls
OF_KINDS = ("panda", "gantry", "gripper", "skew_axes", "two_arms")
Call = Callable[[Dynamics, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def states(dyn: Dynamics, rows: int, rng: np.random.Generator) -> list[np.ndarray]:
    many = [models.random_state(rng, dyn.n) for _ in range(rows)]
    return [np.array(x) for x in zip(*many, strict=True)]


def single(dyn: Dynamics, call: Call, batch: list[np.ndarray]) -> np.ndarray:
    """The first rows by single calls, which Pinocchio answers."""
    return np.array([call(dyn, *(x[k] for x in batch)) for k in range(ROWS)])


@pytest.mark.parametrize(
    ("name", "what"),
    always(
        product((*models.ROBOTS, *models.DRIVEN, "panda_free"), CALLS),
        *zip(cycle((*OF_KINDS, "flexible_arm", "panda_free")), CALLS),
    ),
)
def test_equals_single_calls(name: str, what: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(name)
    batch = states(dyn, MANY, rng)
    agrees(dyn, what, batch, CALLS[what](dyn, *batch))


def agrees(dyn: Dynamics, what: str, batch: list[np.ndarray], made: np.ndarray) -> None:
    alone = single(dyn, CALLS[what], batch)
    assert made.shape[1:] == alone.shape[1:]
    if what != "forward":
        assert_close(made[:ROWS], alone, ALGEBRA)
        return
    # In torques, for M⁻¹ may be large.
    M, tau = dyn.mass_matrix(batch[0][:ROWS]), batch[2][:ROWS]
    scale = abs(M) @ abs(alone)[..., None] + abs(tau)[..., None]
    missing = M @ (made[:ROWS] - alone)[..., None]
    np.testing.assert_array_less(abs(missing).max(axis=1), ALGEBRA * scale.max(axis=1))


@pytest.mark.parametrize("terms", TERMS, ids=str)
def test_chosen_terms(terms: int, rng: np.random.Generator) -> None:
    dyn = models.dynamics("gripper")
    batch = states(dyn, MANY, rng)
    alone = single(dyn, lambda d, *x: d.inverse(*x, terms), batch)
    assert_close(dyn.inverse(*batch, terms)[:ROWS], alone, ALGEBRA)


@cache
def with_law(name: str, law: str) -> Dynamics:
    """A robot with a law at its last joint and none elsewhere."""
    given = models.scene(name).model_dump(exclude_unset=True)
    joint = models.dynamics(name).joint_names[-1]
    return Dynamics(load_scene(given | {"joints": {joint: LAWS.get(law, {})}}))


@pytest.mark.parametrize(
    ("name", "law"), always(product(OF_KINDS, LAWS), *zip(cycle(OF_KINDS), LAWS))
)
def test_laws(name: str, law: str, rng: np.random.Generator) -> None:
    dyn, lawless = with_law(name, law), with_law(name, "none")
    batch = states(dyn, MANY, rng)
    batch[1][: MANY // 4] = 0.0
    a = dyn.forward(*batch)
    agrees(dyn, "forward", batch, a)
    moving = slice(MANY // 4, None)  # friction at rest may be anything up to its level
    q, v, tau = (x[moving] for x in batch)
    # A factor by load is found by repetition, and what M⁻¹ has made large comes back as torque.
    size = abs(dyn.mass_matrix(q)) @ abs(a[moving])[..., None]
    error = abs(dyn.inverse(q, v, a[moving]) - tau) / (abs(tau).max() + size.max())
    assert error.max() < INVERSE_PAIR
    if law != "flexible gear":  # a flexible gear's rotor is not rigidly on the links
        assert abs(lawless.forward(*batch) - a)[moving].max() > 1e-3


def test_a_tree_of_many_joints(rng: np.random.Generator) -> None:
    dyn = Dynamics(load_scene(random_tree(rng, DENSE_AT_MOST + 1)))
    batch = states(dyn, MANY, rng)
    for what in ("forward", "coriolis_matrix"):
        agrees(dyn, what, batch, CALLS[what](dyn, *batch))


@pytest.mark.parametrize("what", CALLS)
def test_rows_do_not_depend_on_their_neighbours(what: str, rng: np.random.Generator) -> None:
    dyn, call = with_law("panda", "dry"), CALLS[what]
    batch = states(dyn, 2 * MANY + 3, rng)
    together = call(dyn, *batch)
    order = rng.permutation(len(together))
    np.testing.assert_array_equal(together[order], call(dyn, *(x[order] for x in batch)))
    np.testing.assert_array_equal(together[:MANY], call(dyn, *(x[:MANY] for x in batch)))


def test_vectors_that_serve_every_row_and_strides(rng: np.random.Generator) -> None:
    dyn = models.dynamics("panda")
    q = rng.uniform(-1.0, 1.0, (dyn.n, 2 * MANY)).T[::2]
    still = np.zeros(dyn.n)
    np.testing.assert_allclose(dyn.inverse(q, still, still), dyn.gravity(q), 0.0, 1e-10)
    wide = rng.uniform(-1.0, 1.0, (MANY, 3 * dyn.n))
    for x in (wide[:, : dyn.n], wide[::-1, dyn.n : 2 * dyn.n], wide[:, ::3], np.float32(q)):
        clean = np.array(x, dtype=float, order="C")
        for v, tau in ((x, still), (still, x)):
            plain = [np.broadcast_to(y, x.shape).astype(float) for y in (v, tau)]
            np.testing.assert_array_equal(dyn.forward(x, v, tau), dyn.forward(clean, *plain))


def test_without_room_on_the_disk_pinocchio_answers(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    """Equal to the bit, since both are computed by Pinocchio; what is given is not written on."""

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(compiler, "build", full)
    dyn = Dynamics(models.scene("two_link"))
    batch = states(dyn, MANY, rng)
    kept = [x.copy() for x in batch]
    for call in CALLS.values():
        np.testing.assert_array_equal(call(dyn, *batch)[:ROWS], single(dyn, call, batch))
    np.testing.assert_array_equal(batch, kept)


def test_only_what_is_asked_for_is_built(
    caplog: pytest.LogCaptureFixture, rng: np.random.Generator
) -> None:
    dyn = Dynamics(models.scene("two_link"))
    batch = states(dyn, MANY, rng)
    with caplog.at_level(logging.INFO):
        dyn.forward(*(x[: MANY - 1] for x in batch))
        assert not dyn.spring(*batch[:2]).any()  # it has none
        assert not caplog.messages
        for _ in range(2):
            dyn.forward(*batch)
    assert caplog.messages == ["building code for batches: forward dynamics of 2 joints"]


def test_a_position_without_mass(rng: np.random.Generator) -> None:
    """A rod with a point mass nods on a post that turns: upright, the post has no inertia."""
    dyn = Dynamics("""<robot name="rod"><link name="base"/><link name="post"/>
      <link name="rod"><inertial><origin xyz="0 0 0.5"/><mass value="1"/>
        <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
      <joint name="turn" type="continuous"><parent link="base"/><child link="post"/>
        <axis xyz="0 0 1"/></joint>
      <joint name="nod" type="continuous"><parent link="post"/><child link="rod"/>
        <axis xyz="0 1 0"/></joint></robot>""")
    q, v, tau = (rng.uniform(0.5, 1.0, (MANY, 2)) for _ in range(3))
    assert np.isfinite(dyn.forward(q, v, tau)).all()
    q[77, 1] = 0.0
    for given in ((q, v, tau), (q[77], v[77], tau[77])):
        with pytest.raises(ModelError, match="joint 'turn' moves no mass"):
            dyn.forward(*given)


def test_an_acceleration_that_overflows(rng: np.random.Generator) -> None:
    dyn = models.dynamics("panda")
    q, v, tau = rng.uniform(-1.0, 1.0, (3, MANY, dyn.n))
    v[5] = 1e200
    for given in ((q, v, tau), (q[5], v[5], tau[5])):
        with pytest.raises(InvalidInput, match="overflows"):
            dyn.forward(*given)
    v[5] = 0.0  # and then it is usable again
    assert np.isfinite(dyn.forward(q, v, tau)).all()


@pytest.mark.parametrize("what", ["inverse", "forward", "energy"])
def test_wrong_numbers_and_shapes(what: str) -> None:
    dyn, call = models.dynamics("panda"), CALLS[what]
    q, v, x = np.zeros((3, MANY, dyn.n))
    for bad in (np.nan, -np.inf):
        wrong = q.copy()
        wrong[200, 3] = bad
        with pytest.raises(InvalidInput, match=rf"[qv]\[200, 3\] = {bad} of joint 'panda_joint4'"):
            call(dyn, wrong, v, x)
    for given in ((q[:-1], v, x), (q[:, :-1], v, x), (q[None], v, x)):
        with pytest.raises(InvalidInput, match=r"the same length|shape"):
            call(dyn, *given)
