# SPDX-License-Identifier: Apache-2.0
"""Installs arm_studies: by colcon as an ament_python package, by pip as a library.

Name, version and the rest come from package.xml, what pip has to install from requirements.txt.
"""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

HERE = Path(__file__).resolve().parent  # colcon may run a link to this file
MANIFEST = ElementTree.parse(HERE / "package.xml").getroot()
PACKAGE, VERSION = MANIFEST.findtext("name"), MANIFEST.findtext("version")
ABOUT = ("name", "version", "description", "license", "maintainer", "author")
CODE = ("**/*.c", "**/*.h", "**/*.cpp", "**/*.hpp")

setup(
    **{key: MANIFEST.findtext(key) for key in ABOUT},
    maintainer_email=MANIFEST.find("maintainer").get("email"),
    python_requires=">=3.12",
    install_requires=[
        f"arm_sim=={VERSION}",
        *(
            line
            for line in (HERE / "requirements.txt").read_text().splitlines()
            if line and not line.startswith("#")
        ),
    ],
    extras_require={"test": ["pytest"]},
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={"": [*CODE, "py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    zip_safe=False,
    entry_points={"console_scripts": ["studies = arm_studies.cli.main:main"]},
)
