# SPDX-License-Identifier: Apache-2.0
"""Counts lines against their ceilings in `ceilings.toml`; `--lower` brings these down to today's.

Code of ``src`` is counted by package and language, without docstrings, comments and blank lines;
tests, benchmarks and tools by all their lines. Ceilings only fall.
"""

import ast
import io
import re
import sys
import tokenize
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
CEILINGS = ROOT / "tools/ceilings.toml"
LANGUAGES = {"python": {".py"}, "c": {".c", ".h", ".cpp", ".hpp"}}
WHOLE, SOURCES = ("test", "benchmarks", "tools"), {".sh"}.union(*LANGUAGES.values())
NO_CODE = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
    tokenize.ENCODING, tokenize.ENDMARKER,
}  # fmt: skip
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
COMMENT_OR_TEXT = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"', re.DOTALL)


def lines_of_python(text: str) -> int:
    """Lines with code, without docstrings."""
    lines = {
        line
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type not in NO_CODE
        for line in range(token.start[0], token.end[0] + 1)
    }
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            lines -= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    return len(lines)


def lines_of_c(text: str) -> int:
    """Lines with code."""
    code = COMMENT_OR_TEXT.sub(lambda m: m[0] if m[0][0] == '"' else "\n" * m[0].count("\n"), text)
    return sum(bool(line.strip()) for line in code.splitlines())


def counted() -> dict[str, dict[str, int]]:
    """Lines today: by package and language, and by folder."""
    counts: dict[str, dict[str, int]] = {}
    for package in sorted(path.parent for path in ROOT.glob("src/*/package.xml")):
        files = [path for path in package.rglob("*") if "build" not in path.parts]
        for language, count in (("python", lines_of_python), ("c", lines_of_c)):
            lines = sum(
                count(path.read_text()) for path in files if path.suffix in LANGUAGES[language]
            )
            if lines:
                counts.setdefault(package.name, {})[language] = lines
    for folder in WHOLE:
        files = [path for path in (ROOT / folder).rglob("*") if path.suffix in SOURCES]
        counts.setdefault("whole", {})[folder] = sum(
            len(path.read_text().splitlines()) for path in files if "results" not in path.parts
        )
    return counts


def main() -> int:
    """Compare, or lower the ceilings."""
    ceilings, today = tomllib.loads(CEILINGS.read_text()), counted()
    names = [(group, key) for group, keys in today.items() for key in keys]
    over = [(group, key) for group, key in names if today[group][key] > ceilings[group][key]]
    for group, key in over:
        lines, ceiling = today[group][key], ceilings[group][key]
        print(f"{CEILINGS.name}: {group}.{key} has {lines} lines, allowed are {ceiling}")
    if "--lower" in sys.argv and not over:
        head = CEILINGS.read_text().partition("\n[")[0]
        tables = (
            f"\n[{group}]\n" + "".join(f"{key} = {lines}\n" for key, lines in keys.items())
            for group, keys in today.items()
        )
        CEILINGS.write_text(head + "".join(tables))
    return bool(over)


if __name__ == "__main__":
    sys.exit(main())
