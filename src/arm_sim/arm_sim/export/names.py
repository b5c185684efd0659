# SPDX-License-Identifier: Apache-2.0
"""Names in exported C code: that of the library, and those of frames."""

import re
from collections.abc import Sequence

from arm_dynamics import InvalidInput

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
# Most characters of a library's name, to which functions add theirs
LONGEST = 63
# Words of C and C++; names that CMake reserves; the prefix of a part of libraries (at_rest.py);
# headers that N.h would hide.
_WORDS = frozenset(
    """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char class compl const
    const_cast constexpr continue decltype default delete do double dynamic_cast else enum explicit
    export extern false float for friend goto if inline int long mutable namespace new noexcept not
    not_eq nullptr operator or or_eq private protected public register reinterpret_cast restrict
    return short signed sizeof static static_assert static_cast struct switch template this
    thread_local throw true try typedef typeid typename union unsigned using virtual void volatile
    wchar_t while xor xor_eq
    all clean edit_cache help install m package package_source rebuild_cache test
    rest
    alloca endian features libintl memory pthread sched strings unistd
    assert complex ctype errno fenv inttypes iso646 limits locale math setjmp signal stdalign
    stdarg stdatomic stdbool stddef stdint stdio stdlib stdnoreturn string tgmath threads time
    uchar wchar wctype
    """.split()
)


def library_name(name: str) -> str:
    """Check the name of a library, the prefix of all its functions.

    Raises:
        InvalidInput: If it is no C identifier, or a word that C, C++, CMake or libraries use.
    """
    if not _IDENTIFIER.fullmatch(name) or len(name) > LONGEST:
        raise InvalidInput(
            f"name = {name!r}; allowed: a letter, then letters, digits and underscores, at most "
            f"{LONGEST}"
        )
    if name.lower() in _WORDS:
        raise InvalidInput(
            f"name = {name!r}, which C, C++, CMake or the library itself use; allowed: any other "
            "identifier"
        )
    return name


def from_title(title: str) -> str:
    """A name for a library made from any title, such as that of a robot."""
    name = re.sub(r"\W+", "_", title, flags=re.ASCII).strip("_").lower() or "arm"
    name = name if name[0].isalpha() else f"arm_{name}"
    return f"{name}_arm" if name in _WORDS else name[:LONGEST]


def of_frames(frames: Sequence[str]) -> list[str]:
    """The parts of function names that stand for frames.

    Raises:
        InvalidInput: If two frames have the same part.
    """
    frame_of = dict[str, str]()
    for frame in frames:
        part = re.sub(r"\W", "_", frame, flags=re.ASCII)
        if part in frame_of:
            raise InvalidInput(
                f"frames '{frame_of[part]}' and '{frame}' would both be '{part}' in C; allowed: "
                "one of them"
            )
        frame_of[part] = frame
    return list(frame_of)
