# SPDX-License-Identifier: Apache-2.0
"""Installs arm_dynamics as an ament_python package."""

from setuptools import find_packages, setup

PACKAGE = "arm_dynamics"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="The equations of motion of a robot arm, as a library and as ROS 2 nodes.",
    license="Apache-2.0",
    maintainer="Arm dynamics suite maintainers",
    maintainer_email="maintainers@example.org",
    author="Arm dynamics suite maintainers",
    python_requires=">=3.12",
    extras_require={"test": ["pytest"]},
    packages=find_packages(),
    package_data={"": ["**/*.c", "**/*.h", "**/*.cpp", "**/*.hpp", "**/*.xml", "py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "dynamics = arm_dynamics.ros.dynamics_node:main",
            "controller = arm_dynamics.ros.controller_node:main",
        ]
    },
)
