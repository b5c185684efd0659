# SPDX-License-Identifier: Apache-2.0
"""How a user wants things to be shown."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Wish:
    """How things are to be shown.

    Attributes:
        host: Address to listen at.
        port: Port; None for the usual one or the next.
        over: Whether motions are to be shown of scenes, rather than simulations to touch.
        duration: Of these motions in [s].
        control: What holds arms meanwhile: ``nothing`` or ``weight``.
        scene: Of recordings that bring none.
        topic: Of the joint states of bags that have several.
    """

    host: str
    port: int | None
    over: bool = False
    duration: float = 5.0
    control: str = "nothing"
    scene: str | None = None
    topic: str | None = None
