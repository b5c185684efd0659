# SPDX-License-Identifier: Apache-2.0
"""Exported terms, compiled by the system's compiler, against ``Dynamics``."""

import ctypes
import re
from pathlib import Path

import numpy as np
import pytest
from exported import (
    BITS,
    Library,
    assert_no_compiler_warns,
    assert_portable,
    compilers,
    run_test_program,
)
from samples import always

from arm_dynamics import Dynamics, load_scene
from arm_dynamics.model.frame_motion import FrameMotion
from arm_sim.export import DERIVATIVES, TERMS, export
from tolerances import EXPORT, EXPORT_FORWARD, FINITE_DIFF, assert_close

SCENES = ("panda", "four_bar", "slider_crank_motor", "spring_balanced_arm")
POINTS = 20


class Case:
    """A scene, its library and points at which its loops are closed."""

    def __init__(self, scene: str, folder: Path) -> None:
        self.dynamics = dynamics = Dynamics(scene)
        model, rng = dynamics.model, np.random.default_rng(1)
        self.n, self.folder = model.n, folder / scene
        self.frame = model.frame_names[-1]
        export(model, self.folder, scene, (*TERMS, *DERIVATIVES), tick=False, frames=[self.frame])
        self.libraries = [Library(self.folder, scene, BITS, name) for name in compilers()]
        self.library = self.libraries[0]
        self.q, self.v, self.a = rng.uniform(-1.0, 1.0, (3, POINTS, self.n))
        self.q += model.q0
        if model.scene.bilateral:
            closure = dynamics.constrained.closure
            for k in range(POINTS):
                near = model.q0 + 0.05 * self.q[k]
                self.q[k], self.v[k] = closure.closed(near, self.v[k], closure.initially_active)

    def results(self, function: str, *names: str, shape: tuple[int, ...]) -> np.ndarray:
        """Of every compiler the same bits."""
        rows = list(zip(*(getattr(self, name) for name in names), strict=True))
        made = [np.array([library(function, *row, shape=shape) for row in rows])
                for library in self.libraries]  # fmt: skip
        assert len({results.tobytes() for results in made}) == 1
        return made[0]


@pytest.fixture(scope="module", params=SCENES)
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Case:
    return Case(request.param, tmp_path_factory.mktemp("exported"))


def test_terms_are_those_of_dynamics(case: Case) -> None:
    dyn, n = case.dynamics, case.n
    for function, names, shape, expected in (
        ("inverse_dynamics", "qva", (n,), dyn.inverse),
        ("mass_matrix", "q", (n, n), dyn.mass_matrix),
        ("coriolis_matrix", "qv", (n, n), dyn.coriolis_matrix),
        ("gravity", "q", (n,), dyn.gravity),
        ("friction", "qv", (n,), lambda q, v: dyn.friction(v, q=q)),
        ("energy", "qv", (2,), lambda q, v: np.array(dyn.energy(q, v)).T),
    ):
        given = [getattr(case, name) for name in names]
        assert_close(case.results(function, *names, shape=shape), expected(*given), EXPORT)


def test_forward_dynamics_are_those_of_dynamics(case: Case) -> None:
    """To rounding those of Pinocchio; to the bit those of ``Dynamics.compiled``, without loops."""
    made = case.results("forward_dynamics", "q", "v", "a", shape=(case.n,))
    assert_close(made, case.dynamics.forward(case.q, case.v, case.a), EXPORT_FORWARD)
    if not case.dynamics.model.scene.bilateral:
        compiled = Dynamics(case.dynamics.model).compiled()
        points = zip(case.q, case.v, case.a, strict=True)
        assert np.array_equal(made, [compiled.forward(*point) for point in points])


def test_frames_are_those_of_pinocchio(case: Case) -> None:
    motion = FrameMotion(case.dynamics.model, case.frame, "local_world_aligned")
    for suffix in ("", f"_{case.frame}"):
        poses = case.results(f"pose{suffix}", "q", shape=(4, 4))
        jacobians = case.results(f"jacobian{suffix}", "q", shape=(6, case.n))
        for q, T, J in zip(case.q, poses, jacobians, strict=True):
            position, rotation = motion.placement(q)
            assert_close(T, np.block([[rotation, position[:, None]], [0, 0, 0, 1]]), EXPORT)
            assert_close(J, motion.jacobian(q), EXPORT)


@pytest.mark.parametrize(
    ("what", "acted"), [("inverse_dynamics", "a"), ("forward_dynamics", "tau")]
)
def test_derivatives_are_those_of_differences(case: Case, what: str, acted: str) -> None:
    q, v, a = case.q[0], case.v[0], case.a[0]
    n, step = case.n, 1e-6
    entry = getattr(case.library.loaded, f"{case.library.name}_{what}_derivatives")
    made = np.full((3, n, n), np.nan)
    pointers = [ctypes.c_void_p(x.ctypes.data) for x in (q, v, a, *made)]
    entry.restype = None
    entry(*pointers)
    for i, by_which in enumerate(made):
        for j in range(n):
            points = [[x.copy() for x in (q, v, a)] for _ in range(2)]
            points[0][i][j] += step
            points[1][i][j] -= step
            ahead, behind = (case.library(what, *point, shape=(n,)) for point in points)
            assert_close(by_which[:, j], (ahead - behind) / (2 * step), FINITE_DIFF)


def test_the_test_program_passes_and_notices_a_wrong_number(case: Case, tmp_path: Path) -> None:
    source, wrong = case.folder / f"test_{case.library.name}.c", tmp_path / "wrong.c"
    status, said = run_test_program(case.library, source, tmp_path / "program")
    assert status == 0 and "all results are right" in said
    text = source.read_text()
    first = re.search(r"double gravity_0\[\d+\] = \{([^,}]+)", text)
    assert first is not None
    for number in (repr(float(first[1]) + 1e-9), "NAN"):
        wrong.write_text(text[: first.start(1)] + number + text[first.end(1) :])
        status, said = run_test_program(case.library, wrong, tmp_path / "program")
        assert status == 1 and re.search(r"gravity +\S+ WRONG", said)


@pytest.mark.parametrize("case", always(SCENES, "four_bar"), indirect=True)
def test_code_is_portable(case: Case) -> None:
    """No warning, nothing for sanitizers; mathematics only, and nothing that can be written."""
    assert_portable(case.folder, case.library.name)


DRY = {"*": {"friction": {"coulomb": 1.0, "static": 1.5, "viscous": 0.1}}}
FLOOR = {"type": "contact", "frame": "coupler", "plane": {"point": [0.0, 0.0, -9.0]}}


@pytest.mark.parametrize("name", always(["two_link", "four_bar"], "two_link"))
def test_joints_that_dry_friction_holds_stay_at_rest_as_in_dynamics(
    name: str, tmp_path: Path
) -> None:
    """The linkage is above a floor, whose modes are no inputs of its forward dynamics."""
    scene = load_scene(name).model_dump(exclude_unset=True) | {"joints": DRY}
    if linkage := "constraints" in scene:
        scene["constraints"].append(FLOOR)
    dyn, rng = Dynamics(scene), np.random.default_rng(3)
    export(dyn.model, tmp_path, "arm", ("forward_dynamics",), tick=True)
    library, n = Library(tmp_path, "arm"), dyn.n
    assert_no_compiler_warns(tmp_path, "arm")
    stuck = 0
    for _ in range(60):
        q = dyn.model.q0 + (0.0 if linkage else rng.uniform(-0.3, 0.3, n))
        v = np.where(rng.random(n) < 0.6, 0.0, rng.uniform(-1.0, 1.0, n)) * (not linkage)
        tau = dyn.gravity(q) + rng.uniform(-3.0, 3.0, n) * rng.choice([0.01, 1.0])
        expected = dyn.forward(q, v, tau)
        assert_close(library("forward_dynamics", q, v, tau, shape=(n,)), expected, EXPORT_FORWARD)
        stuck += int((expected == 0.0).any())
    assert 0 < stuck
