# SPDX-License-Identifier: Apache-2.0
"""The plugins are described as they are."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

PACKAGE = Path(__file__).parents[1]


def test_the_classes_are_those_that_are_described() -> None:
    """In the files by which pluginlib finds them, and in the code that registers them."""
    code = "".join(path.read_text() for path in (PACKAGE / "src").glob("*.cpp"))
    pattern = r"PLUGINLIB_EXPORT_CLASS\(([\w:]+),\s*([\w:]+)\)"
    described = [
        (item.get("type"), item.get("base_class_type"))
        for file in ("hardware.xml", "controllers.xml")
        for item in ElementTree.parse(PACKAGE / file).getroot().iter("class")
    ]
    assert sorted(re.findall(pattern, code)) == sorted(described)
