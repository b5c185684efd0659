# SPDX-License-Identifier: Apache-2.0
"""The walks of docs/project/extending.md work: their code is applied to a copy of src."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/project/extending.md").read_text()
WALKS = dict(re.findall(r"\n## ([^\n]+)\n(.*?)(?=\n## |\Z)", PAGE, re.DOTALL))
MOST_FILES = {
    "A term": 3,
    "A friction law with a state": 4,
    "An integrator": 2,
    "A controller": 2,
    "A service": 6,
}


def applied(walk: str, root: Path) -> Path:
    """A copy of src with the code of a walk."""
    skipped = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "src", root / "src", symlinks=True, ignore=skipped)
    for language, block in re.findall(r"\n```(\w*)\n(.*?)```", WALKS[walk], re.DOTALL):
        first, _, text = block.partition("\n")
        path = root / first.split()[-1]
        if language == "diff":
            path.write_text(changed(path.read_text(), text))
        else:
            assert not path.exists()
            path.write_text(text)
        if path.suffix == ".py":
            compile(path.read_text(), path, "exec")
    return root / "src"


def changed(text: str, diff: str) -> str:
    """A file with the hunks of a diff; what is before must stand in it exactly once."""
    for hunk in diff.split("@@\n")[1:]:
        lines = hunk.splitlines(keepends=True)
        before, after = ("".join(x[1:] for x in lines if x[0] in signs) for signs in (" -", " +"))
        assert text.count(before) == 1, f"{text.count(before)} times in the file:\n{before}"
        text = text.replace(before, after)
    return text


PACKAGES = ("arm_dynamics", "arm_sim", "arm_studies")


def run(src: Path, script: str) -> None:
    folders = [*(src / name for name in PACKAGES), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, folders))},
        cwd=src, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("walk", MOST_FILES)
def test_walk_touches_few_files(walk: str) -> None:
    files = set(re.findall(r"^(?:\+\+\+|#) (src/\S+)$", WALKS[walk], re.MULTILINE))
    assert 0 < len(files) <= MOST_FILES[walk]


def test_a_term_is_asked_of_everything_that_follows_from_the_table(tmp_path: Path) -> None:
    run(
        applied("A term", tmp_path),
        """
import numpy as np, pinocchio as pin
from pathlib import Path
from arm_dynamics import Dynamics
from arm_sim.export import export

dyn = Dynamics("arm_sim/arm_sim/scenes/two_link.urdf")
q = np.random.default_rng(0).normal(size=(300, 2))
right = [pin.centerOfMass(dyn.model.pin, dyn.model.pin.createData(), x).copy() for x in q]
np.testing.assert_allclose(dyn.centre_of_mass(q), right, atol=1e-14)
np.testing.assert_allclose(dyn.compiled().centre_of_mass(q[0]), right[0], atol=1e-14)
export("arm_sim/arm_sim/scenes/two_link.urdf", "out", name="two", tick=False)
assert "void two_centre_of_mass(const double* q, double* c);" in Path("out/two.h").read_text()
assert "centre_of_mass" in Path("out/test_two.c").read_text()
""",
    )


def test_friction_law_works_everywhere(tmp_path: Path) -> None:
    run(
        applied("A friction law with a state", tmp_path),
        """
import numpy as np
from arm_sim import Simulator

def joint(friction):
    return {"friction": {"viscous": 0.0} | friction}

scene = {
    "robot": {"urdf": "arm_sim/arm_sim/scenes/two_link.urdf"},
    "gravity": [0, 0, 0],
    "joints": {
        "shoulder": joint({"coulomb": 2.0, "dahl": {"sigma0": 400.0}}),
        "elbow": joint({"coulomb": 1.0, "lugre": {"sigma0": 1000.0, "sigma1": 5.0}}),
    },
}
sim = Simulator(scene, backend="vm")
assert "Dahl friction" in str(sim.plan) and len(sim.z_names) == 2
motion = sim.run(0.1, lambda state: np.array([6.0, 0.0]))
q = motion.q[:, 0] - motion.q[0, 0]
z = motion.z[:, sim.z_names.index("shoulder Dahl deflection")]
assert q[-1] > 0.02 and np.all(np.diff(q) >= 0.0)
np.testing.assert_allclose(z, 2.0 / 400.0 * (1.0 - np.exp(-400.0 / 2.0 * q)), atol=1e-7)
np.testing.assert_allclose(motion.balance, 0.0, atol=1e-6)
""",
    )


def test_integrator_has_its_order(tmp_path: Path) -> None:
    run(
        applied("An integrator", tmp_path),
        """
import numpy as np
from arm_sim import Simulator

def end(integrator, dt):
    sim = Simulator("arm_sim/arm_sim/scenes/pendulum.yaml", integrator, dt, backend="vm")
    return sim.run(0.4).q[-1, 0]

truth = end("dop853", 0.01)
coarse, fine = (abs(end("kutta_38", dt) - truth) for dt in (0.04, 0.02))
assert 3.5 < np.log2(coarse / fine) < 4.5, (coarse, fine)
""",
    )


def test_controller_leads_the_arm_and_is_a_choice_of_the_node(tmp_path: Path) -> None:
    run(
        applied("A controller", tmp_path),
        """
import numpy as np
from arm_dynamics.control import NAMES, Settings, make_controller
from arm_dynamics.control.compiled_law import compiled_law
from arm_dynamics.trajectory import Reference
from arm_sim import Simulator

assert "slotine_li" in NAMES
sim = Simulator({
    "robot": {"urdf": "arm_sim/arm_sim/scenes/two_link.urdf"},
    "joints": {"*": {"friction": {"viscous": 0.0}}},
    "initial": {"position": {"shoulder": -0.5, "elbow": 0.8}},
}, backend="vm")
goal = Reference(np.array([0.3, 1.2]), np.zeros(2), np.zeros(2))
control = make_controller("slotine_li", sim.dynamics, Settings(bandwidth=8.0, sliding_rate=8.0))
assert compiled_law(control) is not None
motion = sim.run(2.5, lambda state: control.torque(state, goal))
np.testing.assert_allclose(motion.q[-1], goal.q, atol=1e-6)
""",
    )


def test_service_is_a_command_with_options(tmp_path: Path) -> None:
    run(
        applied("A service", tmp_path),
        """
from click.testing import CliRunner
from arm_sim.cli.call import call

said = CliRunner().invoke(call, ["forward-kinematics", "--help"]).output
for words in ("Poses of a frame in the world", "--frame TEXT", "--position NUMBERS", "--joints"):
    assert words in said, said
""",
    )
