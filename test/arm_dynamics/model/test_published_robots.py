# SPDX-License-Identifier: Apache-2.0
"""Published robots: torques as by an independent reading and method, or refused by name."""

import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from samples import sampled

from arm_dynamics import Dynamics, ModelError, Term, load_scene
from arm_dynamics.scene.urdf.description import read_urdf
from models.newton_euler import Robot
from models.shapes import REFUSED, shapes
from tolerances import INVERSE_PAIR

NEAR = 1e-12
RIGID = Term.INERTIA | Term.CORIOLIS | Term.GRAVITY  # losses of followers are told apart elsewhere
SHAPES = shapes()
MANY = 45  # links; more would take longer than they could tell


def descriptions() -> list[Path]:
    """Those of example-robot-data."""
    spec = find_spec("pinocchio")
    assert spec is not None and spec.origin is not None
    prefix = next(p for p in Path(spec.origin).parents if p.name == "cmeel.prefix")
    return sorted((prefix / "share/example-robot-data/robots").rglob("*.urdf"))


def assert_torques(text: str, dynamics: Dynamics, rng: np.random.Generator) -> None:
    """Those at a state drawn by chance, without losses."""
    q, v, a = rng.uniform(-1.0, 1.0, (3, dynamics.n))
    names = dynamics.joint_names
    state = [dict(zip(names, x.tolist(), strict=True)) for x in (q, v, a)]
    found = Robot(text).torques(*state, losses=False)
    assert found.keys() == set(names)
    expected, own = [found[name] for name in names], dynamics.inverse(q, v, a, RIGID)
    size = abs(np.array(expected)).max()
    np.testing.assert_allclose(own, expected, rtol=0.0, atol=NEAR * max(size, 1e-9))


@pytest.mark.parametrize("name", SHAPES)
def test_shapes(name: str, rng: np.random.Generator) -> None:
    text = SHAPES[name]
    if name in REFUSED:
        with pytest.raises(ModelError, match=REFUSED[name]):
            Dynamics(text)
        return
    dynamics = Dynamics(text)
    assert_torques(text, dynamics, rng)
    q, v, tau = rng.uniform(-1.0, 1.0, (3, dynamics.n))
    try:
        a = dynamics.forward(q, v, tau)
    except ModelError as error:
        assert re.search(r"joints? '\w+'.* mass, so no torque determines", str(error))
        assert "without inertia" in name or "moves nothing" in name
    else:
        size = 1.0 + abs(dynamics.mass_matrix(q)) @ abs(a)
        np.testing.assert_array_less(abs(dynamics.inverse(q, v, a) - tau), INVERSE_PAIR * size)


NOT_READ = {"ur3", "alex_psyonic_hands", "iris_simple", "quadrotor_base"}
"""Two that are no robots, without links, one with a joint that follows a fixed one; and two have
no joint."""


BULKY = {"double_pendulum_simple", "simple_humanoid", "simple_humanoid_classical"}
"""Robots with links of 0.1 to 0.6 kg and 1 kg m²."""


@pytest.mark.parametrize("each", sampled([5, 1], 1))
def test_robots_as_they_are_published_are_read(
    each: int, rng: np.random.Generator, caplog: pytest.LogCaptureFixture
) -> None:
    """All of example-robot-data, or a part of it with those that are refused."""
    refused, doubtful, compared = set(), 0, 0
    paths = descriptions()
    for path in [p for k, p in enumerate(paths) if k % each == 0 or p.stem in NOT_READ]:
        text = path.read_text()
        try:
            urdf = read_urdf(text)
            doubtful += bool(urdf.doubtful)
            if len(urdf.links) <= MANY:
                caplog.clear()
                assert_torques(text, Dynamics(load_scene(path)), rng)
                odd = [x for x in caplog.messages if "no rigid body has" not in x]
                assert bool(odd) == (path.stem in BULKY), odd
                compared += 1
        except ModelError as error:
            refused.add(path.stem)
            assert re.search("robot description: |joint '|robot: no joint is left", str(error))
    assert refused == NOT_READ
    assert doubtful > 10 // each
    assert compared > 40 // each
