# SPDX-License-Identifier: Apache-2.0
"""Pages of the site on a telephone, opened from disk: nothing is too wide, broken or elsewhere.

They are those that ``./arm docs`` has built, some drawn by lot, and all with ``--nightly``;
without a site there is nothing to test.
"""

from pathlib import Path

import numpy as np
import pytest
from browser import needed

from arm_sim.view.pictures import page_in_browser

SITE = Path(__file__).parents[2] / "reports/site"
PAGES = 15  # that are drawn
WIDTH = 390  # pixels of a telephone

# What reaches beyond the page without scrolling inside itself, and pictures that are not there.
_TROUBLES = """() => {
  const width = document.documentElement.clientWidth;
  const inside = part => {
    for (let outer = part.parentElement; outer; outer = outer.parentElement) {
      const scrolls = ['auto', 'scroll', 'hidden'].includes(getComputedStyle(outer).overflowX);
      if (scrolls && outer.getBoundingClientRect().right <= width + 1) return true;
    }
    return false;
  };
  const wide = [...document.querySelectorAll('.bd-article *')].filter(part => {
    const box = part.getBoundingClientRect();
    return box.width > 0 && box.right > width + 1 && !inside(part);
  });
  const broken = [...document.images].filter(picture => !picture.naturalWidth);
  return [
    ...wide.map(part => 'too wide: ' + part.outerHTML.slice(0, 80)),
    ...broken.map(picture => 'no picture: ' + picture.getAttribute('src')),
  ];
}"""
# Cells with a word that is broken: one that is narrower than its longest word would be alone.
_BROKEN_WORDS = """() => [...document.querySelectorAll('.bd-article td')].filter(cell => {
  const style = getComputedStyle(cell);
  return style.overflowWrap === 'anywhere' || style.wordBreak === 'break-all';
}).map(cell => 'broken words: ' + cell.textContent.slice(0, 40))"""


def site() -> list[Path]:
    """The pages that are built; the test is skipped without them."""
    pages = [*SITE.glob("*.html"), *SITE.glob("[!_]*/**/*.html")]
    if not pages:
        pytest.skip("no site in reports/site: ./arm docs --no-gallery builds it")
    return sorted(pages)


@pytest.mark.group("view")
def test_pages_fit_a_telephone_and_need_no_network(
    request: pytest.FixtureRequest, rng: np.random.Generator
) -> None:
    pages, found = site(), dict[str, list[str]]()
    needed()
    if not request.config.getoption("--nightly"):
        pages = rng.choice(np.array(pages, dtype=object), min(PAGES, len(pages)), False)
    with page_in_browser("about:blank", (WIDTH, 800)) as browser:
        asked = list[str]()
        browser.on("requestfailed", lambda request: asked.append(f"failed: {request.url}"))
        browser.on("request", lambda request: asked.append(request.url))
        for page in pages:
            asked.clear()
            browser.goto(page.as_uri(), wait_until="load")
            troubles = browser.evaluate(_TROUBLES) + browser.evaluate(_BROKEN_WORDS)
            troubles += [url for url in asked if not url.startswith(("file:", "data:"))]
            if troubles:
                found[str(page.relative_to(SITE))] = troubles
    assert found == {}
