# SPDX-License-Identifier: Apache-2.0
"""Figures that several pages state are the same everywhere: ``docs/facts.yaml``."""

import re
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
FACTS = yaml.safe_load((ROOT / "docs/facts.yaml").read_text())


@pytest.mark.parametrize("name", FACTS)
def test_pages_state_the_figure(name: str) -> None:
    fact = FACTS[name]
    number = fact["value"].split()[0]
    assert len(fact["stated"]) > 1
    for page, words in fact["stated"].items():
        text = " ".join((ROOT / page).read_text().split())
        assert number in words
        assert " ".join(words.split()) in text, page


def test_figures_of_the_readme_are_of_the_file() -> None:
    """Every row of the README's table of measurements that states a figure has a fact."""
    readme = (ROOT / "README.md").read_text()
    table = readme.split("| | measured |\n")[1].split("\n\n")[0]
    stated = [fact["stated"].get("README.md", "") for fact in FACTS.values()]
    rest = table
    for words in filter(None, stated):
        rest = rest.replace(words, "")
    assert re.findall(r"\d+e-\d+|[\d.]+ [µm]s|1/\d+", rest) == ["1 ms"]  # the step itself
