# SPDX-License-Identifier: Apache-2.0
"""Installs arm_sim as an ament_python package."""

from glob import glob

from setuptools import find_packages, setup

PACKAGE = "arm_sim"
SHARED = ("config", "launch", "rviz")

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Simulates robot arms, as a library, as a ROS 2 node and on the command line.",
    license="Apache-2.0",
    maintainer="Arm dynamics suite maintainers",
    maintainer_email="maintainers@example.org",
    author="Arm dynamics suite maintainers",
    python_requires=">=3.12",
    extras_require={"test": ["pytest"]},
    packages=find_packages(),
    package_data={
        "": [
            "**/*.c",
            "**/*.h",
            "**/*.cpp",
            "**/*.hpp",
            "py.typed",
            "scenes/**/*.yaml",
            "scenes/**/*.urdf",
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/scenes", sorted(glob(f"{PACKAGE}/scenes/*"))),  # package://arm_sim/…
        *((f"share/{PACKAGE}/{folder}", sorted(glob(f"{folder}/*"))) for folder in SHARED),
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": ["sim = arm_sim.ros.sim_node:main", "arm = arm_sim.cli.main:main"]
    },
)
