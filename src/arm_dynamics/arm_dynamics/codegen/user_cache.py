# SPDX-License-Identifier: Apache-2.0
"""The user's own cache of compiled code, in a folder that only the user may enter.

An entry ends in the digest of its bytes. One that does not match it, or belongs to another user,
does not count.
"""

import atexit
import hashlib
import logging
import os
import shutil
import stat
import tempfile
from functools import cache
from pathlib import Path

from arm_dynamics.codegen.compiled_scenes import write_atomically

_DIGEST = hashlib.sha256().digest_size
_log = logging.getLogger(__name__)


def folder() -> Path:
    """The folder, owned by the user, mode 0700.

    If it cannot be created, this process uses a new temporary folder.
    """
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    own = Path(base) / "arm_dynamics"
    try:
        own.mkdir(mode=0o700, parents=True, exist_ok=True)
        mode = own.lstat()
        is_private = mode.st_uid == os.getuid() and not mode.st_mode & 0o077
        if stat.S_ISDIR(mode.st_mode) and is_private and os.access(own, os.W_OK):
            return own
    except OSError:
        pass
    return _temporary_folder(own)


@cache
def _temporary_folder(unusable: Path) -> Path:
    _log.warning(
        "'%s' cannot be used: compiled code is kept for this process only; "
        "XDG_CACHE_HOME names a folder that can be written", unusable,
    )  # fmt: skip
    temporary = Path(tempfile.mkdtemp(prefix="arm_dynamics-"))
    atexit.register(shutil.rmtree, temporary, ignore_errors=True)
    return temporary


def digest(*parts: str) -> str:
    """Digest of some texts, as a file name."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:40]


def read(entry: Path) -> bytes | None:
    """Content of an entry; None if it is missing, damaged or another user's."""
    try:
        if not stat.S_ISREG(entry.lstat().st_mode) or entry.lstat().st_uid != os.getuid():
            return None
        content = entry.read_bytes()
    except OSError:
        return None
    is_intact = hashlib.sha256(content[:-_DIGEST]).digest() == content[-_DIGEST:]
    return content[:-_DIGEST] if len(content) > _DIGEST and is_intact else None


def write(entry: Path, content: bytes) -> None:
    """Write an entry atomically."""
    write_atomically(entry, content + hashlib.sha256(content).digest(), 0o600)
