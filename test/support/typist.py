# SPDX-License-Identifier: Apache-2.0
"""Types commands in the domain of the nodes that they call."""

import json
from typing import Any, NamedTuple

import pytest

from arm_studies.cli.main import main


class Result(NamedTuple):
    """What a command left behind."""

    exit_code: int
    output: str


class Typist:
    """Types ``./arm call``, or the commands whose first words are given."""

    def __init__(
        self, domain: int, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str],
        first: tuple[str, ...] = ("call",),
    ) -> None:  # fmt: skip
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        self._capfd, self._first = capfd, first

    def __call__(self, *words: str, timeout: float = 20.0) -> Result:
        with pytest.raises(SystemExit) as end:
            main([*self._first, *words, "--timeout", str(timeout)])
        return Result(int(end.value.code or 0), "".join(self._capfd.readouterr()))


def answer(result: Result) -> Any:
    """What a command printed as JSON."""
    assert result.exit_code == 0, result.output
    return json.loads(result.output)
