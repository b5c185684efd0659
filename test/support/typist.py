# SPDX-License-Identifier: Apache-2.0
"""Types ``./arm call``."""

import json
from typing import Any, NamedTuple

import pytest

from arm_studies.cli.main import main


class Result(NamedTuple):
    """What a command left behind."""

    exit_code: int
    output: str


class Typist:
    """Types commands in the domain of the nodes that they call."""

    def __init__(
        self, domain: int, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        self._capfd = capfd

    def __call__(self, *words: str, timeout: float = 20.0) -> Result:
        with pytest.raises(SystemExit) as end:
            main(["call", *words, "--timeout", str(timeout)])
        return Result(int(end.value.code or 0), "".join(self._capfd.readouterr()))


def answer(result: Result) -> Any:
    """What a command printed as JSON."""
    assert result.exit_code == 0, result.output
    return json.loads(result.output)
