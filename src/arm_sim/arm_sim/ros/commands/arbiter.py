# SPDX-License-Identifier: Apache-2.0
"""Admits one stream of commands at a time for each joint."""

from ctypes import Structure, addressof, byref

from arm_dynamics import InvalidInput
from arm_dynamics.exceptions import plain
from arm_sim.ros.node_library import TICKS, library

STREAM = 10  # commands without a long pause that form a stream


class Source(Structure):
    """A source of commands: ``stream_t`` of ticks.h, where the fields are explained.

    Attributes:
        joints: The joints that it commanded last.
    """

    _fields_ = TICKS.fields("stream_t")
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
        self._streams: dict[str, Source] = {}

    @property
    def sources(self) -> tuple[str, ...]:
        """Sources that commanded joints recently."""
        return tuple(source for source, stream in self._streams.items() if self._is_recent(stream))

    @property
    def leader(self) -> tuple[str, frozenset[int]] | None:
        """The only source that is remembered, and the joints that it commanded last."""
        if not self.has_one_source:
            return None
        ((name, stream),) = self._streams.items()
        return name, stream.joints

    @property
    def has_one_source(self) -> bool:
        """Whether only one source is remembered."""
        return len(self._streams) == 1

    @property
    def has_conflict(self) -> bool:
        """Whether a command was refused within the last ``patience`` ticks."""
        return self.refused > 0 and self.now - self._refused_at <= self.patience

    def admit(self, source: str, joints: frozenset[int]) -> None:
        """Register a command.

        Raises:
            InvalidInput: If the stream of another source commands one of these joints.
        """
        if not self.has_one_source or source not in self._streams:
            self._streams = {name: s for name, s in self._streams.items() if self._is_recent(s)}
            self._share_only()  # also where the command is refused
            for other, stream in self._streams.items():
                if other != source and stream.count >= STREAM and stream.joints & joints:
                    self.refused += 1
                    self._refused_at = self.now
                    self.last_refusal = (
                        f"two controllers: '{plain(source, 80)}' is refused while "
                        f"'{plain(other, 80)}' commands these joints"
                    )
                    raise InvalidInput(f"{self.last_refusal}; allowed: one stream for each joint")
        stream = self._streams.setdefault(source, Source())
        stream.joints = joints
        library().stream_count(byref(stream), self.now, self.patience)
        self._share_only()

    def _is_recent(self, stream: Source) -> bool:
        return bool(library().stream_is_remembered(byref(stream), self.now, self.patience))

    def reset_counters(self) -> None:
        """Reset the counter."""
        self.refused = 0

    def forget(self) -> None:
        """Forget all sources."""
        self._streams.clear()
        self._share_only()

    def _share_only(self) -> None:
        """Let C know the only source."""
        self.only = addressof(next(iter(self._streams.values()))) if self.has_one_source else None
