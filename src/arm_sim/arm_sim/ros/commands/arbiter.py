# SPDX-License-Identifier: Apache-2.0
"""Admits one stream of commands at a time for each joint."""

from __future__ import annotations

from ctypes import Structure, addressof, byref

from arm_dynamics import InvalidInput
from arm_dynamics.exceptions import plain
from arm_sim.ros.node_library import LOOP, TICKS, library

STREAM = 10  # commands without a long pause that form a stream


class Source(Structure):
    """A source of commands: ``stream_t`` of loop.h, where the fields are explained.

    Attributes:
        joints: The joints that it commanded last.
    """

    _fields_ = LOOP.fields("stream_t")
    joints: frozenset[int] = frozenset()


class Arbiter(Structure):
    """Tracks which source commands which joints; a stream of commands owns its joints.

    A source is identified by a command's ``header.frame_id``, in which our controllers write their
    name and process. A source that has been silent for ``patience`` ticks loses its joints, and
    one that sends only occasional commands does not own any. It is ``arbiter_t`` of ticks.h.

    Attributes:
        patience: Ticks after which a silent source is gone.
        refused: Number of commands that were refused.
        last_refusal: Message of the last refusal.
        now: Number of ticks so far; one for which sources had less time counts in part.
    """

    _fields_ = TICKS.fields("arbiter_t")

    def __init__(self, patience: int) -> None:
        super().__init__(patience=patience)
        self.refused = 0
        self.last_refusal = ""
        self._refused_at = 0.0
        self._heard: dict[str, Source] = {}

    @property
    def sources(self) -> tuple[str, ...]:
        """Sources that commanded joints recently."""
        return tuple(source for source, heard in self._heard.items() if self._fresh(heard))

    @property
    def leader(self) -> tuple[str, frozenset[int]] | None:
        """The only source that is remembered, and the joints that it commanded last."""
        if not self.alone:
            return None
        ((name, heard),) = self._heard.items()
        return name, heard.joints

    @property
    def alone(self) -> bool:
        """Whether only one source is remembered."""
        return len(self._heard) == 1

    @property
    def conflict(self) -> bool:
        """Whether a command was refused within the last ``patience`` ticks."""
        return self.refused > 0 and self.now - self._refused_at <= self.patience

    def admit(self, source: str, joints: frozenset[int]) -> None:
        """Register a command.

        Raises:
            InvalidInput: If the stream of another source commands one of these joints.
        """
        if not self.alone or source not in self._heard:
            self._contest(source, joints)
        heard = self._heard.setdefault(source, Source())
        heard.joints = joints
        library().hear(byref(heard), self.now, self.patience)
        self._share()

    def _contest(self, source: str, joints: frozenset[int]) -> None:
        self._heard = {s: heard for s, heard in self._heard.items() if self._fresh(heard)}
        for other, heard in self._heard.items():
            if other != source and heard.count >= STREAM and heard.joints & joints:
                self.refused += 1
                self._refused_at = self.now
                self.last_refusal = (
                    f"two controllers: '{plain(source, 80)}' is refused while "
                    f"'{plain(other, 80)}' commands these joints"
                )
                raise InvalidInput(f"{self.last_refusal}; allowed: one stream for each joint")

    def _fresh(self, heard: Source) -> bool:
        return bool(library().is_remembered(byref(heard), self.now, self.patience))

    def forget(self) -> None:
        """Forget all sources."""
        self._heard.clear()
        self._share()

    def _share(self) -> None:
        """Let C know the only source."""
        self.only = addressof(next(iter(self._heard.values()))) if self.alone else None
