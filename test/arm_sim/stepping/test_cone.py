# SPDX-License-Identifier: Apache-2.0
"""Forces of contacts with Coulomb friction: the compiled solver against the law itself."""

import numpy as np
import pytest

from models.engine import APART, SLIDES, STICKS, UNSOLVABLE, Answer, solve_cone, solve_cones
from tolerances import assert_close

LAW = 1e-9
"""What a force may lack of the law, relative to the largest."""


def problem(rng: np.random.Generator, nc: int, rank: int) -> tuple[np.ndarray, np.ndarray]:
    """W and c of ``nc`` points of an arm with ``rank`` joints."""
    A = rng.normal(size=(3 * nc, rank))
    return A @ A.T / 3, A @ rng.normal(size=rank)


def assert_obeys(W: np.ndarray, c: np.ndarray, mu: np.ndarray, answer: Answer) -> None:
    """Either open, or at rest inside the cone, or on its edge against the motion."""
    scale = max(1.0, float(np.abs(answer.force).max()))
    motion = (W @ answer.force.ravel() + c).reshape(-1, 3)
    rows = zip(answer.state, answer.force, motion, mu, answer.direction, strict=True)
    for state, (r_n, *r_t), (w_n, *w_t), m, d in rows:
        speed = np.hypot(*w_t)
        assert r_n >= -1e-15 * scale and w_n >= -LAW * scale
        assert abs(r_n * w_n) < LAW * scale
        assert np.hypot(*r_t) <= m * r_n + LAW * scale
        if state == APART:
            assert r_n == 0.0 and not np.any(r_t)
        elif state == STICKS:
            assert speed < LAW * scale
        else:
            assert_close(np.array(r_t) / scale, -m * r_n * np.array(d) / scale, LAW)
            assert_close(np.array(w_t) / scale, speed * np.array(d) / scale, LAW)


@pytest.mark.parametrize(("nc", "rank"), [
    (1, 2), (1, 4), (2, 3), (2, 7), (3, 4), (3, 10), (4, 3), (4, 13),
])  # fmt: skip
def test_forces_obey_the_law_of_coulomb(nc: int, rank: int, rng: np.random.Generator) -> None:
    """In space, redundant or not; where W is regular there always is an answer."""
    seen, missing = set(), 0
    for _ in range(150):
        W, c = problem(rng, nc, rank)
        mu = rng.uniform(0.0, 1.5, nc) * (rng.random(nc) > 0.1)
        answer = solve_cones(W, c, mu)
        if not answer.found or UNSOLVABLE in answer.state:
            missing += 1
            continue
        seen |= set(answer.state.tolist())
        assert_obeys(W, c, mu, answer)
    assert seen == {APART, SLIDES, STICKS}
    assert missing == 0 if rank >= 3 * nc else missing <= 4


def test_a_contact_that_closes_without_force_is_apart() -> None:
    """On the verge: no acceleration across, nothing to carry."""
    state, force = solve_cone(np.eye(3), np.array([0.0, -3.0, 0.0]), 0.5)
    assert state == APART and not force.any()


def test_a_sliding_contact_that_jams_has_no_answer() -> None:
    """Friction that presses together faster than the normal force opens (Painlevé)."""
    W = np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    c, ahead = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0])
    assert solve_cone(W, c, 0.5, ahead)[0] == SLIDES
    assert solve_cone(W, c, 0.5, -ahead)[0] == SLIDES
    assert solve_cone(W, c, 1.5, -ahead)[0] == UNSOLVABLE


def test_two_directions_close_together_are_both_found(rng: np.random.Generator) -> None:
    """Of slender bodies and rough planes: only one of them may have a force that pushes."""
    for _ in range(500):
        A = rng.normal(size=(3, 3)) * 10.0 ** rng.uniform(-1.5, 1.5, 3)
        W, c, mu = A @ A.T, rng.normal(size=3), np.array([rng.uniform(0.0, 10.0)])
        answer = solve_cones(W, c, mu)
        assert answer.found and answer.state[0] == solve_cone(W, c, mu[0])[0] != UNSOLVABLE
    W = np.array([[3.3407, 3.7213, -3.571], [3.7213, 9.9285, -4.453], [-3.571, -4.453, 4.3927]])
    _, force = solve_cone(W, np.array([-0.20782, 0.35233, -8.69169]), 0.87276)
    assert_close(force, [1.0805, -0.0093, 0.9430], 1e-3)
