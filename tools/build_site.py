# SPDX-License-Identifier: Apache-2.0
"""Builds the site from docs/, strictly: every warning is an error. Run by ``./arm docs``."""

import subprocess
import sys
import webbrowser
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import click

DOCS = Path(__file__).resolve().parents[1] / "docs"
SITE = click.Path(path_type=Path, file_okay=False)


@click.command(context_settings={"show_default": True})
@click.option("--out", type=SITE, default=DOCS.parent / "reports/site", help="Folder to write to.")
@click.option("--gallery/--no-gallery", default=True, help="Run the scripts of the gallery.")
@click.option("--open", "show", is_flag=True, help="Serve the site to a browser, until Ctrl-C.")
@click.option("--print", "page", metavar="PAGE", help="Print a page, as reference/scene-keys.")
def build(out: Path, gallery: bool, show: bool, page: str | None) -> None:
    """Build the site: tutorials, how-to, concepts, reference, gallery and laboratory.

    Pages that have not changed are kept from the last time. A warning, for example a link that
    leads nowhere or a script of the gallery that fails, makes the build fail.
    """
    from arm_dynamics.exceptions import did_you_mean  # here: --help needs nothing
    from arm_sim.cli.output import waiting

    options = ["-W", "--keep-going", "-nj", "auto", "-d", f"{out}-cache"]
    if page:
        pages = [str(path.relative_to(DOCS).with_suffix("")) for path in DOCS.rglob("*.md")]
        if page not in pages:
            raise click.BadParameter(f"'{page}' is not in docs{did_you_mean(page, pages)}")
        out = out.with_name(f"{out.name}-text")
        options = ["-b", "text", "-t", "one_page", "-D", f"root_doc={page}"]
    options += [] if gallery else ["-D", "plot_gallery=0"]
    status, sphinx = ["starting"], [sys.executable, "-um", "sphinx", *options, str(DOCS), str(out)]
    with waiting(lambda: status[-1], in_lines=True):
        process = subprocess.Popen(sphinx, stdout=subprocess.PIPE, text=True, errors="replace")
        status.extend(line for line in map(str.strip, process.stdout or ()) if line)
    if process.wait():
        sys.exit(process.returncode)
    if page:
        click.echo_via_pager((out / f"{page}.txt").read_text())
        return
    click.echo(f"site: {out / 'index.html'}")
    if show:  # from disk, browsers let no page read another, as the search does for its excerpts
        handler = partial(SimpleHTTPRequestHandler, directory=out)
        with ThreadingHTTPServer(("localhost", 0), handler) as server:
            click.echo(f"http://localhost:{server.server_port}, until Ctrl-C")
            webbrowser.open(f"http://localhost:{server.server_port}")
            server.serve_forever()


if __name__ == "__main__":
    build(prog_name="./arm docs")
