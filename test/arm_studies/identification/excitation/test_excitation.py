# SPDX-License-Identifier: Apache-2.0
"""Exciting motions: the information they contain, their limits, and what is refused."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from arm_dynamics import ArmModel, Dynamics, InvalidInput, Term, load_scene
from arm_dynamics.task_space import TaskSpace
from arm_dynamics.trajectory import Trajectory
from arm_studies.identification.excitation import Box, Room, excite
from arm_studies.identification.excitation.columns import distinct, random_states, regressor
from arm_studies.identification.excitation.fourier import basis
from arm_studies.identification.regression.regressor import PER_BODY, RigidRegressor

CONTACT = {
    "type": "contact", "name": "floor", "frame": "elbow", "point": [0.5, 0, 0],
    "plane": {"point": [0, 0, -0.75]},
}  # fmt: skip


@cache
def planar(**changes: Any) -> Dynamics:
    scene = load_scene("two_link")
    contacts = (CONTACT,) if changes.get("floor") else ()
    return Dynamics(load_scene(scene.model_dump(exclude_unset=True) | {"constraints": contacts}))


@cache
def found(floor: bool = False, box: Box | None = None) -> tuple[Room, Any]:
    room = Room(planar(floor=floor), acceleration=30.0, box=box)
    return room, excite(room, period=4.0, harmonics=3, attempts=2 if floor or box else 4)


def dense(motion: Trajectory) -> tuple[np.ndarray, ...]:
    states = [motion.sample(t) for t in np.linspace(0.0, motion.duration, 1501)]
    return tuple(np.array([getattr(state, part) for state in states]) for part in "qva")


def test_the_series_begins_and_ends_at_rest_and_its_derivatives_are_right() -> None:
    period, t = 7.0, np.linspace(0.0, 7.0, 2001)
    q, v, a = basis(t, period, 4)
    assert q.shape == (6, 2001)
    np.testing.assert_allclose([x[:, [0, -1]] for x in (q, v, a)], 0.0, atol=1e-13)
    step = t[1] - t[0]
    np.testing.assert_allclose(np.gradient(q, step, axis=1)[:, 1:-1], v[:, 1:-1], atol=1e-4)
    np.testing.assert_allclose(np.gradient(v, step, axis=1)[:, 1:-1], a[:, 1:-1], atol=1e-4)


def test_as_many_parameters_are_told_apart_as_are_known_of_the_arm() -> None:
    """43 of the bodies (Gaz and others, RA-L 4(4), 2019, table I), 5 armatures, and of each joint
    viscous and Coulomb friction and an offset.
    """
    model = ArmModel(load_scene("panda"))
    W = regressor(model, 0.1 * np.ones(model.n))
    ends = -np.ones(model.n), np.ones(model.n)
    states = random_states(*ends, ends[1], 5.0 * ends[1], 400)
    assert distinct(W, states, ends[1]).size1_out(0) == 43 + 5 + 3 * model.n


@pytest.mark.parametrize("scene", ["two_link", "panda"])
def test_torques_of_pinocchio_are_a_combination_of_the_columns(scene: str) -> None:
    dynamics = Dynamics(scene)
    n, model = dynamics.n, dynamics.model
    W = regressor(model, np.ones(n))
    ones = np.ones(n)
    states = random_states(-ones, ones, ones, 5.0 * ones, 200)
    rigid = Term.INERTIA | Term.CORIOLIS | Term.GRAVITY
    tau = np.concatenate([dynamics.inverse(*state, rigid) for state in states])
    rows = np.vstack([W(*state).full() for state in states])
    solution = np.linalg.lstsq(rows, tau, rcond=1e-12)[0]
    np.testing.assert_allclose(rows @ solution, tau, atol=1e-9 * abs(tau).max())


def test_limits_hold_at_every_instant_and_one_of_them_is_used() -> None:
    room, best = found()
    model = room.model
    q, v, a = dense(best.motion)
    tau = np.array([room.dynamics.inverse(*state) for state in zip(q, v, a, strict=True)])
    reach = model.position_upper - model.position_lower
    shares = np.array([
        abs(v / (0.8 * model.velocity_limit)).max(), abs(a / 30.0).max(),
        abs(tau / (0.8 * model.effort_limit)).max(),
        (abs(q - (model.position_upper + model.position_lower) / 2) / (0.45 * reach)).max(),
    ])  # fmt: skip
    assert np.all(shares <= 1.0 + 1e-9)
    assert shares.max() > 0.9
    for rest in (v[[0, -1]], a[[0, -1]], q[[0, -1]] - room.start):
        np.testing.assert_allclose(rest, 0.0, atol=1e-12)


def test_it_is_more_informative_than_random_motions_and_reports_how_much() -> None:
    """Largest of 20 random motions as large as limits allow, by the same measure."""
    from arm_studies.identification.excitation.search import _Search

    room, best = found()
    search, rng = _Search(room, 4.0, 3, "all"), np.random.default_rng(5)
    chances = [search.gain(search.random(rng)) for _ in range(20)]
    assert best.information > max(chances) + best.parameters * np.log(1.5)
    assert best.information == pytest.approx(max(best.attempts), rel=1e-9)
    assert best.parameters == 13
    assert 1.0 < best.condition < 100.0


def test_where_masses_are_the_aim_they_are_told_better_and_it_is_said_how_well() -> None:
    """Against least squares on Pinocchio's regressor, of densities with a known total."""
    room, every = found()
    aimed = excite(room, period=4.0, harmonics=3, attempts=2, aim="masses")
    assert aimed.masses is not None
    theirs, ours = (_least_squares(room, one) for one in (every, aimed))
    np.testing.assert_allclose(aimed.masses, ours, rtol=0.05)
    assert ours.mean() < 0.9 * theirs.mean()


def _least_squares(room: Room, found: Any) -> np.ndarray:
    """Standard deviations of masses after one period, 5 % of noise, 1 kHz, shape (bodies,)."""
    model, states = room.model, [found.motion.sample(t) for t in np.arange(0.0, 4.0, 1e-3)]
    q, v, a = (np.array([getattr(state, part) for state in states]) for part in "qva")
    rigid = RigidRegressor(model)
    shapes = np.kron(np.eye(model.n), np.ones((PER_BODY, 1))) * rigid.nominal[:, None]
    masses = rigid.nominal[::PER_BODY] / rigid.nominal[::PER_BODY].sum()
    rows = [np.concatenate([masses, np.zeros(3 * model.n)])[None] / 1e-4,
            np.eye(4 * model.n)[: model.n] / 0.1]  # fmt: skip
    bodies = rigid(q, v, a) @ shapes
    taken = room.dynamics.inverse(q, v, a)
    for j in range(model.n):
        own = np.zeros((len(q), 3 * model.n))
        own[:, 3 * j : 3 * j + 3] = np.column_stack([a[:, j], v[:, j], np.sign(v[:, j])])
        noise = 0.05 * np.sqrt(np.mean(taken[:, j] ** 2))
        rows.append(np.hstack([bodies[:, j], own]) / noise)
    R = np.linalg.qr(np.vstack(rows), mode="r")
    return np.linalg.norm(np.linalg.inv(R)[: model.n], axis=1)


def test_a_box_and_a_floor_are_kept_clear_of() -> None:
    box = Box((-0.6, -2.0, -0.9), (1.5, 2.0, 0.4), ("tip",))
    task = TaskSpace(planar().model, "tip")

    def tips(motion: Trajectory) -> np.ndarray:
        return np.array([task.pose(q).position for q in dense(motion)[0]])

    boxed, floored, free = (found(**kept)[1] for kept in ({"box": box}, {"floor": True}, {}))
    assert np.all(tips(boxed.motion) >= np.array(box.lower))
    assert np.all(tips(boxed.motion) <= np.array(box.upper))
    assert tips(free.motion)[:, 2].max() > 0.4
    assert tips(floored.motion)[:, 2].min() > -0.75


def room(**changes: Any) -> Room:
    return Room(planar(), **changes)


REFUSED: dict[str, Callable[[], object]] = {
    "share = 0.0; more than 0": lambda: room(share=0.0),
    "'shoulder' at -3.2 rad or m; allowed: -2.79 to": lambda: room(given_start=[-3.2, 0.0]),
    "start: gravity loads joint 'shoulder' with": lambda: room(share=0.1),
    "'tip' from the lower side": lambda: room(box=Box((5, 5, 5), (6, 6, 6), ("tip",))),
    "box: unknown frame 'hand'": lambda: room(box=Box((-2, -2, -2), (2, 2, 2), ("hand",))),
    "first below the second": lambda: Box((0, 0, 0), (1, 0, 1), ("tip",)),
    "an open chain is expected": lambda: Room(Dynamics("four_bar")),
    "harmonics": lambda: excite(room(), harmonics=1),
    "aim": lambda: excite(room(), aim="mass"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("said", REFUSED)
def test_what_leaves_no_room_is_refused(said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        REFUSED[said]()
