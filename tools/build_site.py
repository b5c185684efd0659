# SPDX-License-Identifier: Apache-2.0
"""Builds the site from docs/, strictly: every warning is an error. Run by ``./arm docs``."""

from __future__ import annotations

import subprocess
import sys
import webbrowser
from pathlib import Path

import click

ROOT = Path(__file__).resolve().parents[1]


@click.command(context_settings={"show_default": True})
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=ROOT / "reports/site",
    help="Folder to write the site into.",
)
@click.option("--gallery/--no-gallery", default=True, help="Run the scripts of the gallery.")
@click.option("--open", "show", is_flag=True, help="Open the site in a browser.")
@click.option("--print", "page", metavar="PAGE", help="Print a page, as reference/scene-keys.")
def build(out: Path, gallery: bool, show: bool, page: str | None) -> None:
    """Build the site: tutorials, how-to, concepts, reference, gallery and laboratory.

    Pages that have not changed are kept from the last time. A warning, for example a link that
    leads nowhere or a script of the gallery that fails, makes the build fail.
    """
    from arm_sim.cli.output import waiting  # here: --help needs nothing

    cache = out.with_name(f"{out.name}-cache")
    if page and not (ROOT / "docs" / f"{page}.md").is_file():
        raise click.BadParameter(f"'{page}': a page of docs is expected", param_hint="--print")
    out = out.with_name(f"{out.name}-text") if page else out
    options = ["-W", "--keep-going", "-n", "-j", "auto", "-d", cache, ROOT / "docs", out]
    if page:
        options[:0] = ["-b", "text"]
    if page or not gallery:
        options += ["-D", "plot_gallery=0"]
    status, command = ["starting"], [sys.executable, "-um", "sphinx", *map(str, options)]
    with waiting(lambda: status[-1], in_lines=True):
        sphinx = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, errors="replace")
        assert sphinx.stdout is not None
        status.extend(line for line in map(str.strip, sphinx.stdout) if line)
        failed = sphinx.wait()
    if failed:
        sys.exit(failed)
    if page:
        click.echo_via_pager((out / f"{page}.txt").read_text())
        return
    click.echo(f"site: {out / 'index.html'}")
    if show:
        webbrowser.open((out / "index.html").resolve().as_uri())


if __name__ == "__main__":
    build(prog_name="./arm docs")
