# SPDX-License-Identifier: Apache-2.0
"""What C headers declare, for ctypes: fields of structures, constants, types of functions.

A structure that Python and C share is declared in C and nowhere else. Only the C that the
suite's own headers use is read; anything else is an error, so nothing is misread silently.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

_NUMBERS: dict[str, Any] = {
    "char": ctypes.c_char, "uint8_t": ctypes.c_uint8, "int": ctypes.c_int,
    "int64_t": ctypes.c_int64, "long long": ctypes.c_longlong, "size_t": ctypes.c_size_t,
    "double": ctypes.c_double, "real": ctypes.c_double,
}  # fmt: skip
_COMMENTS = re.compile(r"/\*.*?\*/|//[^\n]*|^[ \t]*#[^\n]*", re.DOTALL | re.MULTILINE)
_QUALIFIERS = re.compile(r"\bconst\b")
_SPACE = re.compile(r"\s+")
_DECLARATION = re.compile(r"((?:[^;{}]|\{[^{}]*\})*);")
_ENUM = re.compile(r"enum (?:\w+ )?\{(.*)\}$")
_STRUCT = re.compile(r"typedef struct(?: \w+)? \{(.*)\} (\w+)$")
_OPAQUE = re.compile(r"typedef struct \w+ \w+$")
_POINTER_TYPE = re.compile(r"typedef [\w *]+\(\*(\w+)\) ?\(.*\)$")
_FUNCTION = re.compile(r"(EXPORT |QUICK )?(.*?[ *])(\w+) ?\((.*)\)$")
_POINTER_FIELD = re.compile(r"[\w *]+\(\*(\w+)\) ?\(.*\)$")
_FIELDS = re.compile(r"(long long|\w+)((?:\*| ).*)$")
_NAME = re.compile(r"([* ]*)(\w+) ?(?:\[([\w +]+)\])?$")


class Header:
    """A C header, whose pointers are ``c_void_p``.

    Attributes:
        folder: The folder that contains it.
        constants: Values of its enumerators, and of those in ``uses``, by name.

    Example:
        >>> LOOP = Header(folder / "loop.h")
        >>> class Due(Structure):
        ...     _fields_ = LOOP.fields("due_t")
        >>> LOOP.bind(library)
    """

    def __init__(self, path: Path, *uses: Header, only: str = "") -> None:
        """Read a header.

        Args:
            path: The file.
            uses: Headers that it includes and whose types and constants it uses.
            only: The only structures and enumerations to read, in their order, for a file that
                contains other code; empty: all.

        Raises:
            ValueError: If it contains a declaration of another kind, or not these.
        """
        self._path, self.folder = path, path.parent
        self._functions = dict[str, tuple[Any, list[Any], bool]]()
        self.constants = dict[str, int]()
        self._structures = dict[str, list[tuple[str, Any]]]()
        self._pointers = set[str]()
        for other in uses:
            self.constants |= other.constants
            self._structures |= other._structures
            self._pointers |= other._pointers
        text = _SPACE.sub(
            " ", _QUALIFIERS.sub("", _COMMENTS.sub("", path.read_text(encoding="utf-8")))
        )
        selected = [_declaration(path, text, name) for name in only.split()]
        for declaration in selected or _DECLARATION.findall(text):
            self._read(declaration.strip())

    def structure(self, name: str) -> type[ctypes.Structure]:
        """A structure without methods."""
        return _structure(name, tuple(self._structures[name]))

    def fields(self, structure: str) -> list[tuple[str, Any]]:
        """Fields of a structure, for ``ctypes.Structure._fields_``."""
        return list(self._structures[structure])

    def bind(self, library: ctypes.CDLL) -> None:
        """Set the types of a library's functions to those marked EXPORT or QUICK here.

        Those that are QUICK are called with the interpreter lock.
        """
        locked = ctypes.PyDLL(library._name, handle=library._handle)
        for name, (result, arguments, is_quick) in self._functions.items():
            function = getattr(locked if is_quick else library, name)
            function.restype, function.argtypes = result, arguments
            setattr(library, name, function)

    def _read(self, text: str) -> None:
        """Record what one declaration declares."""
        if match := _ENUM.match(text):
            self._read_enumerators(match[1])
        elif match := _STRUCT.match(text):
            members, name = match.groups()
            self._structures[name] = list(self._members(members))
        elif match := _POINTER_TYPE.match(text):
            self._pointers.add(match[1])
        elif not text.startswith("typedef") and (match := _FUNCTION.match(text)):
            mark, result, name, arguments = match.groups()
            if mark:
                is_quick = mark.strip() == "QUICK"
                self._functions[name] = *self._signature(result, arguments), is_quick
        elif not _OPAQUE.match(text):
            raise ValueError(f"{self._path}: cannot read '{text}'")

    def _signature(self, result: str, arguments: str) -> tuple[Any, list[Any]]:
        """Types of a function's result and of its arguments."""
        listed = [] if arguments.strip() in ("", "void") else arguments.split(",")
        kinds = [kind for one in listed for _, kind in self._declarators(one.strip())]
        ((_, kind),) = self._declarators(f"{result}_")
        return kind, kinds

    def _read_enumerators(self, enumerators: str) -> None:
        """Record the values of an enumeration."""
        value = -1
        for one in filter(None, map(str.strip, enumerators.split(","))):
            name, _, number = map(str.strip, one.partition("="))
            value = int(number) if number else value + 1
            self.constants[name] = value

    def _members(self, text: str) -> Iterator[tuple[str, Any]]:
        """Names and types of the members of a structure."""
        for one in filter(None, map(str.strip, text.split(";"))):
            if match := _POINTER_FIELD.match(one):
                yield match[1], ctypes.c_void_p
            else:
                yield from self._declarators(one)

    def _declarators(self, text: str) -> Iterator[tuple[str, Any]]:
        """Names and types in ``int64_t a, *b, c[3]``; of ``void``, the type is None."""
        if (match := _FIELDS.match(text)) is None:
            raise ValueError(f"{self._path}: cannot read '{text}'")
        type_name, names = match.groups()
        for one in names.split(","):
            if (match := _NAME.match(one.strip())) is None:
                raise ValueError(f"{self._path}: cannot read '{text}'")
            stars, name, length = match.groups()
            kind = ctypes.c_void_p if stars.strip() else self._type(type_name, text)
            yield name, kind * self._length(length) if length else kind

    def _type(self, name: str, where: str) -> Any:
        """The type of a name, None for ``void``; ``where`` is the declaration, for messages."""
        if name == "void":
            return None
        if name in self._pointers:
            return ctypes.c_void_p
        if name in self._structures:
            return self.structure(name)
        if name not in _NUMBERS:
            raise ValueError(f"{self._path}: unknown type '{name}' in '{where}'")
        return _NUMBERS[name]

    def _length(self, text: str) -> int:
        """Length of an array: a number, a constant, or a sum of these."""
        length = 0
        for part in map(str.strip, text.split("+")):
            if not part.isdigit() and part not in self.constants:
                raise ValueError(f"{self._path}: unknown length '{part}'")
            length += self.constants[part] if part in self.constants else int(part)
        return length


def _declaration(path: Path, text: str, name: str) -> str:
    """The declaration of a structure or an enumeration in C that also contains other code."""
    match = re.search(rf"typedef struct \{{[^{{}}]*\}} {name}(?=;)|enum {name} \{{.*?\}}", text)
    if match is None:
        raise ValueError(f"{path}: there is no structure or enumeration '{name}'")
    return match[0]


@cache
def _structure(name: str, fields: tuple[tuple[str, Any], ...]) -> type[ctypes.Structure]:
    """The class of a structure that is part of another one."""
    return type(name, (ctypes.Structure,), {"_fields_": list(fields)})
