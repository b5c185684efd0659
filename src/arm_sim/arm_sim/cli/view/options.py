# SPDX-License-Identifier: Apache-2.0
"""Options of the view."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ViewOptions:
    """Options of the view.

    Attributes:
        host: Address to listen on.
        port: Port; None for the default one or the next free one.
        over: Whether scenes are shown as motions, rather than as interactive simulations.
        duration: Duration of these motions in [s].
        control: What holds arms during them: ``nothing`` or ``weight``.
        scene: Scene of recordings without one.
        topic: Topic of the joint states of bags with several.
    """

    host: str
    port: int | None
    over: bool = False
    duration: float = 5.0
    control: str = "nothing"
    scene: str | None = None
    topic: str | None = None
