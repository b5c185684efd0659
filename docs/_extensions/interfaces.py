# SPDX-License-Identifier: Apache-2.0
"""The definitions of our messages and services, as they stand in ``arm_msgs``."""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "src/arm_msgs"


def names() -> list[str]:
    """All of them, such as ``srv/InverseDynamics``."""
    files = sorted([*FOLDER.glob("srv/*.srv"), *FOLDER.glob("msg/*.msg")])
    return [f"{file.parent.name}/{file.stem}" for file in files]


def markdown(kind: str) -> str:
    """Definitions of a kind, ``srv`` or ``msg``, each under its name."""
    blocks = []
    for name in names():
        folder, word = name.split("/")
        if folder == kind:
            text = (FOLDER / f"{name}.{kind}").read_text().strip()
            blocks.append(f"### `arm_msgs/{folder}/{word}`\n\n```text\n{text}\n```\n")
    return "\n".join(blocks)
