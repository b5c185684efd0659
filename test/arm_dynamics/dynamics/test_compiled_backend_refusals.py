# SPDX-License-Identifier: Apache-2.0
"""Large batches refuse the same arguments as single calls, with the same messages."""

from collections.abc import Callable

import numpy as np
import pytest

import models
from arm_dynamics import ArmError, Dynamics, InvalidInput, ModelError
from arm_dynamics.terms.answers import MANY
from models.asked import CALLS as EVERY

CALLS = {what: EVERY[what] for what in ("inverse", "forward", "coriolis_matrix", "energy")}
Words = Callable[[Dynamics, np.ndarray, np.ndarray, np.ndarray], object]


def point_on_a_rod(height: float) -> Dynamics:
    """A post that turns about the vertical; hinged to it, a rod with a point mass at its end."""
    return Dynamics({"robot": {"urdf": f"""<robot name="rod">
      <link name="base"/><link name="post"/>
      <link name="rod"><inertial><origin xyz="0 0 {height}"/><mass value="1"/>
        <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
      <joint name="turn" type="continuous"><parent link="base"/><child link="post"/>
        <axis xyz="0 0 1"/></joint>
      <joint name="nod" type="continuous"><parent link="post"/><child link="rod"/>
        <axis xyz="0 1 0"/></joint></robot>"""}})  # fmt: skip


def said(call: Callable[[], object]) -> tuple[type, str]:
    with pytest.raises(ArmError) as caught:
        call()
    return type(caught.value), str(caught.value)


def test_a_position_without_mass(rng: np.random.Generator) -> None:
    """With the rod upright the post has no inertia; all other points are answered."""
    dyn = point_on_a_rod(0.5)
    q, v, tau = (rng.uniform(0.5, 1.0, (MANY, 2)) for _ in range(3))
    assert np.isfinite(dyn.forward(q, v, tau)).all()
    q[77, 1] = 0.0
    kind, words = said(lambda: dyn.forward(q, v, tau))
    assert (kind, words) == said(lambda: dyn.forward(q[77], v[77], tau[77]))
    assert kind is ModelError and "joint 'turn' moves no mass" in words


def test_a_joint_without_mass(rng: np.random.Generator) -> None:
    dyn = point_on_a_rod(0.0)
    q, v, tau = rng.uniform(-1.0, 1.0, (3, MANY, 2))
    kind, words = said(lambda: dyn.forward(q, v, tau))
    assert (kind, words) == said(lambda: dyn.forward(q[0], v[0], tau[0]))
    assert kind is ModelError and "joints 'turn', 'nod' move no mass" in words
    np.testing.assert_array_equal(dyn.mass_matrix(q), np.zeros((MANY, 2, 2)))
    np.testing.assert_array_equal(dyn.coriolis_matrix(q, v), np.zeros((MANY, 2, 2)))


def test_an_acceleration_that_overflows(rng: np.random.Generator) -> None:
    dyn = models.dynamics("panda")
    q, v, tau = rng.uniform(-1.0, 1.0, (3, MANY, dyn.n))
    v[5] = 1e200
    kind, words = said(lambda: dyn.forward(q, v, tau))
    assert (kind, words) == said(lambda: dyn.forward(q[5], v[5], tau[5]))
    assert kind is InvalidInput and "overflows" in words


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite(call: Words, bad: float) -> None:
    dyn = models.dynamics("panda")
    q, v, x = np.zeros((3, MANY, dyn.n))
    q[200, 3] = bad
    with pytest.raises(InvalidInput, match=rf"[qv]\[200, 3\] = {bad} of joint 'panda_joint4'"):
        call(dyn, q, v, x)


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_shapes_that_do_not_fit(call: Words) -> None:
    dyn = models.dynamics("panda")
    q, v, x = np.zeros((3, MANY, dyn.n))
    for given in ((q[:-1], v, x), (q[:, :-1], v, x), (q[None], v, x)):
        with pytest.raises(InvalidInput, match=r"the same length|shape"):
            call(dyn, *given)


def test_an_instance_stays_usable_after_a_refusal(rng: np.random.Generator) -> None:
    dyn = models.dynamics("panda")
    q, v, tau = rng.uniform(-1.0, 1.0, (3, MANY, dyn.n))
    right = dyn.forward(q, v, tau)
    v_fast = v.copy()
    v_fast[0] = 1e200
    said(lambda: dyn.forward(q, v_fast, tau))
    np.testing.assert_array_equal(dyn.forward(q, v, tau), right)
