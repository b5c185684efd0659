# SPDX-License-Identifier: Apache-2.0
"""Write ``compile_commands.json``, by which editors (clangd) understand the native code.

    ./arm python tools/compile_commands.py            # beside README.md
    ./arm python tools/compile_commands.py --check    # compile each file by itself, write nothing

Every file under ``native/`` is a unit or a header: it is understood by itself. Before those of an
export, a file of ``test/support/exported`` stands for what a library defines. The exit status of
``--check`` is 1 if the compiler refuses a file or warns.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
EXPORTED = ROOT / "test/support/exported"
UNIT = {"fmi2.c", "fmi3.c", "instance.h"}
# Headers are read by themselves too: their functions are used elsewhere, and #pragma once is seen.
WARNINGS = ("-Wall", "-Wextra", "-Wno-unused-function")
LANGUAGE = {".c": ("c", "-std=gnu11"), ".h": ("c", "-std=gnu11"), ".hpp": ("c++", "-std=gnu++17")}


def files() -> list[Path]:
    """All native code of the packages."""
    found = (ROOT / "src").glob("*/*/**/native/**/*")
    return sorted(path for path in found if path.suffix in LANGUAGE)


def places() -> list[str]:
    """Folders of headers: our own, those of Python and NumPy, and of ROS where it is found."""
    own = sorted({str(path.parent) for path in files()})
    prefixes = map(Path, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    ros = sorted(str(place) for prefix in prefixes for place in prefix.glob("include/*"))
    python = sysconfig.get_path("include"), np.get_include()
    return [*(f"-I{place}" for place in (*own, *ros)), *(f"-isystem{place}" for place in python)]


def command(file: Path, where: list[str]) -> list[str]:
    """The command that checks a file."""
    language, standard = LANGUAGE[file.suffix]
    compiler = "c++" if language == "c++" else "cc"
    plain = ("-Wno-psabi",) if language == "c++" else ()
    defined = EXPORTED / ("unit.h" if file.name in UNIT else "scene.h")
    before = ("-include", str(defined)) if "export" in file.parts else ()
    flags = language, standard, *WARNINGS, *plain, *where, *before
    return [compiler, "-x", *flags, "-fsyntax-only", str(file)]


def checked(file: Path, where: list[str]) -> str:
    """What the compiler says of a file; of headers, not that they are the main file."""
    done = subprocess.run(command(file, where), capture_output=True, text=True)
    lines = [
        line for line in done.stderr.splitlines() if ": error: " in line or ": warning: " in line
    ]
    return "\n".join(line for line in lines if "#pragma once in main file" not in line)


def main() -> int:
    """Write the file, or check; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="compile each file by itself")
    options, where = parser.parse_args(), places()
    if options.check:
        if shutil.which("cc") is None or shutil.which("c++") is None:
            sys.exit("compile_commands: no compiler (cc, c++) is found")
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            said = [text for text in pool.map(lambda file: checked(file, where), files()) if text]
        print("\n".join(said) or f"{len(files())} files: no warning")
        return bool(said)
    entries = [
        {"directory": str(ROOT), "file": str(file), "arguments": command(file, where)}
        for file in files()
    ]
    (ROOT / "compile_commands.json").write_text(json.dumps(entries, indent=1) + "\n")
    print(f"compile_commands.json: {len(entries)} files")
    return 0


if __name__ == "__main__":
    sys.exit(main())
