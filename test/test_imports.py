# SPDX-License-Identifier: Apache-2.0
"""The cores know nothing of ROS, and packages nothing of those that stand on them: no module of
theirs imports these, in a process that has done nothing else.
"""

import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src"
ROS = ("rclpy", "arm_msgs", "sensor_msgs", "std_msgs")
NOT_CORE = ("ros", "client", "cli")


def core_modules(package: str) -> list[str]:
    root = SOURCE / package
    paths = [path.relative_to(root).with_suffix("") for path in (root / package).rglob("*.py")]
    names = [path.parts for path in paths if not set(NOT_CORE) & set(path.parts)]
    return sorted(".".join(name).removesuffix(".__init__") for name in names)


ABOVE = {"arm_dynamics": ["arm_sim", "arm_studies"], "arm_sim": ["arm_studies"], "arm_studies": []}


@pytest.mark.parametrize(("package", "above"), ABOVE.items())
def test_core_modules_import_neither_ros_nor_what_stands_on_them(
    package: str, above: list[str]
) -> None:
    modules = core_modules(package)
    assert len(modules) > 3
    code = f"""
import importlib, sys
for name in {modules!r}:
    importlib.import_module(name)
    wrong = [m for m in sys.modules if m.split('.')[0] in {[*ROS, *above]!r}]
    assert not wrong, f'{{name}} imports {{wrong[0]}}'
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.ros
def test_a_node_loads_neither_studies_nor_view() -> None:
    code = """
import sys
import arm_sim.ros.sim_node.node
assert not [m for m in sys.modules if m.startswith(('arm_studies', 'arm_sim.view'))]
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
