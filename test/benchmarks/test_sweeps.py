# SPDX-License-Identifier: Apache-2.0
"""The ten thousand closed loops of the examples, of which only a few are made here."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from benchmarks.sweeps import cli

RUNS = 48


@pytest.mark.nightly  # test/arm_studies/sweeps/test_sharing.py kills and resumes a smaller study
@pytest.mark.group("sweep")
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # the cluster's own sockets
def test_killed_and_resumed_and_on_a_cluster_the_table_is_the_same(tmp_path: Path) -> None:
    out = tmp_path / "sweeps.json"
    options = ["--runs", str(RUNS), "--cluster-workers", "2", "--out", str(out)]
    done = CliRunner().invoke(cli.main, options)
    assert done.exit_code == 0, done.output
    told = json.loads(out.read_text())
    assert told["closed loops"] == told["of them done"] == RUNS
    assert told["killed after"] + told["made when resumed"] == RUNS
    assert 0 < told["made when resumed"] < RUNS
    assert told["resumed: the same bits"] and told["on the cluster: the same bits"]
