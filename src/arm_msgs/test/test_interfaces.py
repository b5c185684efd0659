# SPDX-License-Identifier: Apache-2.0
"""The interfaces are built as they are written, and take numbers."""

from __future__ import annotations

from pathlib import Path

import arm_msgs.msg
import arm_msgs.srv
import pytest

PACKAGE = Path(__file__).parents[1]
WRITTEN = sorted([*PACKAGE.glob("msg/*.msg"), *PACKAGE.glob("srv/*.srv")])


@pytest.mark.parametrize("path", WRITTEN, ids=lambda path: path.stem)
def test_it_is_built_with_every_field(path: Path) -> None:
    built = getattr(getattr(arm_msgs, path.parent.name), path.stem)
    parts = [built.Request, built.Response] if path.suffix == ".srv" else [built]
    for part, text in zip(parts, path.read_text().split("---"), strict=True):
        fields = part.get_fields_and_field_types()
        for line in text.splitlines():
            words = line.partition("#")[0].split()
            if words and "=" not in line.partition("#")[0]:
                assert words[1] in fields
        part()
