# SPDX-License-Identifier: Apache-2.0
"""Structures that Python reads from headers are those that the compiler sees."""

import ctypes
from ctypes import Structure, c_int64
from pathlib import Path
from typing import Any

import pytest

from arm_dynamics.codegen.compiler import FLAGS, build
from arm_dynamics.codegen.header import Header

TEXT = """
/* A comment; with a semicolon. */
#pragma once
#include <stdint.h>
#define EXPORT __attribute__((visibility("default")))
enum { FEW = 3, SOME, LESS = -1 };
typedef struct opaque opaque_t;
typedef double (*function_t)(const double* x, int64_t n);
// one that is part of another
typedef struct {
  uint8_t flag; /* first */
  double number;
} inner_t;
typedef struct outer {
  inner_t inner, more[FEW + 1];
  int64_t a, *b, c[2];
  const char* const* names;
  opaque_t* other;
  int (*call)(const double**, double**, long long*, double*, int);
  function_t function;
  long long big;
  char letter;
} outer_t;
EXPORT int64_t count(const outer_t* outer, double x, long long y);
"""
LAYOUT = """
#include "given.h"
#include <stddef.h>
#define AT(field) offsetof(outer_t, field)
EXPORT int64_t layout[] = {AT(inner), AT(more), AT(a), AT(b), AT(c), AT(names),
                           AT(other), AT(call), AT(function), AT(big), AT(letter),
                           sizeof(outer_t)};
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "given.h"
    path.write_text(text)
    return path


def test_the_layout_is_that_of_the_compiler(tmp_path: Path) -> None:
    fields = Header(written(tmp_path, TEXT)).fields("outer_t")
    outer: Any = type("Outer", (Structure,), {"_fields_": fields})
    places = [getattr(outer, name).offset for name, *_ in fields]
    library = build(LAYOUT, "c", FLAGS, (f"-I{tmp_path}",)).library
    wanted = (c_int64 * (len(fields) + 1)).in_dll(library, "layout")
    assert [*places, ctypes.sizeof(outer)] == list(wanted)
    with pytest.raises(ValueError, match="there is no structure or enumeration 'c_t'"):
        Header(tmp_path / "given.h", only="c_t")


@pytest.mark.parametrize(
    "text, refused",
    [
        ("typedef struct { unsigned a; } s_t;", "unknown type 'unsigned'"),
        ("typedef struct { int64_t a[MANY + 1]; } s_t;", "unknown length 'MANY'"),
    ],
)
def test_what_is_not_understood_is_refused(tmp_path: Path, text: str, refused: str) -> None:
    with pytest.raises(ValueError, match=f"given.h: {refused}"):
        Header(written(tmp_path, text))
