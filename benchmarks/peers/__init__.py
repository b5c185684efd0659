# SPDX-License-Identifier: Apache-2.0
"""The simulators that are compared; those not installed are left out by name.

``base`` is what the benchmark asks of one; each other file adapts one library to it, ``ours``
this suite.
"""

from importlib import import_module

from benchmarks.peers.base import Contestant

ADAPTERS = {
    "MuJoCo": "mujoco",
    "Drake": "drake",
    "Exudyn": "exudyn",
    "SciPy": "scipy",
}


def installed() -> tuple[list[Contestant], dict[str, str]]:
    """Every peer that can be imported, and the reason for each that cannot, by name."""
    contestants: list[Contestant] = []
    missing: dict[str, str] = {}
    for name, module in ADAPTERS.items():
        try:
            contestants += import_module(f"benchmarks.peers.{module}").contestants()
        except ImportError as error:
            missing[name] = str(error)
    return contestants, missing
