# SPDX-License-Identifier: Apache-2.0
"""After a refactoring: does this tree do what a revision did, to the bit?

    ./arm python tools/same_behaviour.py HEAD~3
    ./arm python tools/same_behaviour.py HEAD~3 panda ur10    # these scenes alone

Both write what they compile and compute into folders of texts, which are then compared by ``git
diff``. Only names that users know are asked for, so one script serves both trees.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SCENES = Path("src/arm_sim/arm_sim/scenes")
PACKAGES = ("arm_dynamics", "arm_sim", "arm_studies")
FIXED = ("euler", "semi_implicit_euler", "midpoint", "heun", "rk4", "nystrom4")
ADAPTIVE = ("dopri5", "dop853", "implicit", "auto")
METHODS = [(name, None) for name in FIXED + ADAPTIVE] + [(name, 1e-8) for name in ADAPTIVE]
TERMS = (
    "inverse", "forward", "mass_matrix", "coriolis_matrix", "gravity", "energy",
    "constrained_forward",
)  # fmt: skip
TICKS = 200
# Called as "KEEPER COMPILER ARGUMENT...": keeps the source by its digest, and compiles it.
KEEPER = """#!/bin/sh
for argument; do
    case $argument in
    *.c | *.cpp) cp "$argument" "$KEPT/$(sha256sum "$argument" | cut -c -16).c" ;;
    esac
done
exec "$@" -O0
"""


def record(out: Path, scenes: list[Path]) -> None:
    """Write what the tree that is imported does."""
    compiled = out / "compiled"
    compiled.mkdir(parents=True)
    keeper = out.with_name("keeper")
    keeper.write_text(KEEPER)
    keeper.chmod(0o700)
    os.environ |= {"KEPT": str(compiled), "CC": f"{keeper} cc", "CXX": f"{keeper} c++"}
    for scene in scenes:
        for name, answer in answers(scene):
            try:
                text = numbers(answer())
            except Exception as error:  # what fails must fail alike
                text = f"{type(error).__name__}\n"
            (out / f"{scene.stem}, {name}.txt").write_text(text)


def answers(scene: Path) -> Iterator[tuple[str, Callable[[], Any]]]:
    """What is computed for a scene, by name."""
    for method, tolerance in METHODS:
        label = method if tolerance is None else f"{method} to {tolerance:g}"
        yield label, lambda way=(method, tolerance): motion(scene, *way)
    for term in TERMS:
        for points in ((), (300,)):  # one at a time, and enough for the code of batches
            yield f"{term} {points}", lambda way=(term, points): of_states(scene, *way)


def motion(scene: Path, method: str, tolerance: float | None) -> list[Any]:
    """States and energies under random torques, rollouts, the derivatives of a tick."""
    from arm_sim import Simulator

    sim, rng = Simulator(scene, method, tolerance=tolerance), np.random.default_rng(20)
    size = 1.0 + abs(sim.dynamics.gravity(sim.state.q))
    tau = size * rng.uniform(-1, 1, (TICKS, sim.n))
    q, v = (start + 1e-3 * rng.uniform(-1, 1, (9, sim.n)) for start in (sim.state.q, sim.state.v))
    run = sim.run(TICKS * sim.dt, tau)
    found = [run.q, run.v, run.z, run.command, run.error, run.kinetic, run.potential, run.lost]
    if tolerance is None:
        found.append(sim.rollout(q, v, np.tile(tau[:20], (9, 1, 1)), 20, lanes=8))
    try:
        return [*found, *sim.linearize(sim.state, tau[0])]
    except Exception as error:
        return [*found, type(error).__name__]


def of_states(scene: Path, term: str, points: tuple[int, ...]) -> Any:
    """A term of the dynamics at random states."""
    from arm_dynamics import Dynamics, load_scene

    dynamics = Dynamics(load_scene(scene))
    states = np.random.default_rng(20).uniform(-2, 2, (3, *points, dynamics.n))
    count = {"mass_matrix": 1, "gravity": 1, "coriolis_matrix": 2, "energy": 2}.get(term, 3)
    return getattr(dynamics, term)(*states[:count])


def numbers(answer: Any) -> str:
    """Text that tells any two different numbers apart."""
    if isinstance(answer, tuple | list):
        return "".join(map(numbers, answer))
    if isinstance(answer, str):
        return f"{answer}\n"
    array = np.asarray(answer, dtype=float)
    rows = array.reshape(len(array), -1) if array.ndim and array.size else array.reshape(-1, 1)
    return "\n".join([f"{array.shape}", *(" ".join(map(repr, row)) for row in rows.tolist()), ""])


def recorded(tree: Path, out: Path, scenes: list[str]) -> None:
    """Run this script on a tree, with nothing in its cache."""
    ours = {str(ROOT / "src" / package) for package in PACKAGES}
    kept = [p for p in os.environ.get("PYTHONPATH", "").split(os.pathsep) if p not in ours]
    theirs = [str(tree / "src" / package) for package in PACKAGES]
    environment = {
        "PYTHONPATH": os.pathsep.join(theirs + kept), "XDG_CACHE_HOME": str(out) + "-cache",
        "PYTHONDONTWRITEBYTECODE": "1",
    }  # fmt: skip
    paths = [str(path) for path in sorted((tree / SCENES).glob("*.yaml"))
             if not scenes or path.stem in scenes]  # fmt: skip
    command = [sys.executable, "-P", __file__, "--record", str(out), *paths]
    subprocess.run(command, env=os.environ | environment, cwd=out.parent, check=True)


def main(revision: str, *scenes: str) -> int:
    """Compare this tree with a revision; 1 if they differ."""
    git = ["git", "-C", str(ROOT), "worktree"]
    with tempfile.TemporaryDirectory() as name:
        older, before, after = (Path(name, part) for part in ("tree", "before", "after"))
        subprocess.run([*git, "add", "--quiet", "--detach", str(older), revision], check=True)
        try:
            recorded(older, before, list(scenes))
            recorded(ROOT, after, list(scenes))
        finally:
            subprocess.run([*git, "remove", "--force", str(older)], check=True)
        compare = ["git", "diff", "--no-index", "--stat", "--patch", "before", "after"]
        return subprocess.run(compare, cwd=name, check=False).returncode


if __name__ == "__main__":
    if sys.argv[1:2] == ["--record"]:
        record(Path(sys.argv[2]), [Path(scene) for scene in sys.argv[3:]])
    else:
        sys.exit(main(*sys.argv[1:]))
