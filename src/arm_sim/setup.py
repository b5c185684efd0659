# SPDX-License-Identifier: Apache-2.0
"""Installs arm_sim: by colcon as an ament_python package, by pip as a library.

Name, version and the rest come from package.xml, what pip has to install from requirements.txt.
"""

from glob import glob
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

HERE = Path(__file__).resolve().parent  # colcon may run a link to this file
MANIFEST = ElementTree.parse(HERE / "package.xml").getroot()
PACKAGE, VERSION = MANIFEST.findtext("name"), MANIFEST.findtext("version")
ABOUT = ("name", "version", "description", "license", "maintainer", "author")
CODE = ("**/*.c", "**/*.h", "**/*.cpp", "**/*.hpp")
DATA = ("**/*.srv", "scenes/**/*.yaml", "scenes/**/*.urdf")
SHARED = ("config", "launch", "rviz")


def wanted(name: str) -> list[str]:
    """The packages that a requirements file names."""
    lines = (HERE / name).read_text().splitlines()
    return [line for line in lines if line and not line.startswith("#")]


setup(
    **{key: MANIFEST.findtext(key) for key in ABOUT},
    maintainer_email=MANIFEST.find("maintainer").get("email"),
    python_requires=">=3.12",
    install_requires=[f"arm_dynamics=={VERSION}", *wanted("requirements.txt")],
    extras_require={"robots": wanted("requirements-robots.txt"), "test": ["pytest"]},
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={"": [*CODE, *DATA, "py.typed", "**/CMakeLists.txt", "**/README.md.in"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        # package://arm_sim/…
        (f"share/{PACKAGE}/scenes", sorted(glob(f"{PACKAGE}/scenes/*.*"))),
        (f"share/{PACKAGE}/scenes/lectures", sorted(glob(f"{PACKAGE}/scenes/lectures/*"))),
        *((f"share/{PACKAGE}/{folder}", sorted(glob(f"{folder}/*"))) for folder in SHARED),
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": ["sim = arm_sim.ros.sim_node:main", "arm = arm_sim.cli.main:main"]
    },
)
