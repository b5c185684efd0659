# SPDX-License-Identifier: Apache-2.0
"""C of CasADi functions without what only CasADi itself asks for.

CasADi writes a file that a program may load at run time, with a dozen functions that describe each
one. A library keeps the functions and the helpers that they use, all of them static, so that
several libraries can be linked into one program. The arithmetic is not touched.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from arm_dynamics.codegen.kernel import generate

# int f(const casadi_real** arg, casadi_real** res, casadi_int* iw, casadi_real* w, int mem) {
_FUNCTION = re.compile(
    r"\A((?:static )?[^\n]*\()([^()\n]*\bcasadi_real\*\* arg[^()\n]*)(\) ?\{\n)"
)
_EXPORT = "CASADI_SYMBOL_EXPORT "
_NAME = re.compile(r"(\w+)[(\[]")  # of a function or a table: f( or s0[
_WORD = re.compile(r"\w+")
_USED = re.compile(r"(?<!->)(?<!\.)(?<!\(\*)\b\w+")  # x and y of x->a + y.b, without members
# } scene_t;   typedef struct scene scene_t;   typedef void (*log_t)(
_TYPE = re.compile(r"^(?:\} |typedef \w+ (?:\(\*)?)(\w+)(?:;|\)?\()", re.MULTILINE)
_DEFINED = re.compile(r"^#define (\w+)", re.MULTILINE)
_ENUM = re.compile(r"\benum (\w* ?\{[^}]*)\}")  # enum trouble { NONE, NUMBERS }
_COMMENT = re.compile(r"(/\*.*?\*/)", re.DOTALL)
# What a static definition begins with: its comment, and the word that silences pedantic compilers.
_ABOUT = r"^(?:/\*(?:(?!\*/).)*\*/\n)?(?:__extension__ )?static "
# static int f(int a) { return a; }   and with lines up to the first that is only }
_STATIC_FUNCTION = re.compile(
    _ABOUT + r"([^;={}]*?\)) ?\{(?: [^\n]*\}\n|\n.*?^\}\n)", re.DOTALL | re.MULTILINE
)
# static const double level[7] = {0.0, ...};
_STATIC_TABLE = re.compile(
    _ABOUT + r"const [\w ]*?(\w+)(?:\[[^=;]*\])? = [^;]*;[^\n]*\n", re.DOTALL | re.MULTILINE
)
_MACRO = re.compile(r"^#define (\w+)\b.*(?<!\\)\n", re.MULTILINE)  # of one line
# Truth of numbers, which compilers take for mistakes, and macros that CasADi defines elsewhere.
_PLAIN = (
    (re.compile(r"\((\w+)\?"), r"(\1!=0?"),  # (a1?a2:0)
    (re.compile(r"\(!(\w+)\)"), r"(\1==0)"),  # (!a1)
    (re.compile(r"\((\w+)(\|\||&&)(\w+)\)"), r"(\1!=0\2\3!=0)"),  # (a1&&a2)
    (re.compile(r"\bcasadi_inf\b"), "INFINITY"),
    (re.compile(r"\bcasadi_nan\b"), "NAN"),
)
# CasADi's helpers call fmax and fmin only where C99 is declared, which C++ does not do:
# /* Pre-c99 compatibility */ #if ... #else (what is kept) #endif
_OLD_C = re.compile(r"^/\* Pre-c99.*?^#else\n(.*?)^#endif\n", re.DOTALL | re.MULTILINE)


def static_functions(functions: Sequence[ca.Function]) -> str:
    """C source of functions, each ``static int NAME(arg, res, iw, w, mem)``.

    Required definitions: ``casadi_real`` and ``casadi_int``, and the elementary functions of
    ``codegen/native/scalar.h``.
    """
    definitions = dict(_definitions(generate(functions)))
    kept = _reachable(definitions, [function.name() for function in functions])
    return "\n".join(_static(text) for name, text in definitions.items() if name in kept)


def without_unused(source: str) -> str:
    """C source without the static functions, tables and macros that nothing uses."""
    parts = _parts(source)
    left = Counter(_words(source))
    dropped = set[_Part]()
    while unused := [p for p in parts if p not in dropped and left[p.name] == p.words[p.name]]:
        dropped |= set(unused)
        for part in unused:
            left -= part.words
    for part in sorted(dropped, key=lambda part: part.begin, reverse=True):
        source = source[: part.begin] + source[part.end :]
    return re.sub(r"\n{3,}", "\n\n", source)


def prefixed(source: str, prefix: str) -> str:
    """C source in which all names that it defines for itself begin with a prefix."""
    names = {part.name for part in _parts(source)}
    names |= set(_TYPE.findall(source)) | set(_DEFINED.findall(source))
    for enumerators in _ENUM.findall(source):
        names |= set(re.findall(r"\b[^\W\d]\w*", _COMMENT.sub("", enumerators)))
    own_name = re.compile(rf"\b(?:{'|'.join(sorted(names))})\b")
    pieces = _COMMENT.split(source)  # every other one is a comment
    pieces[::2] = [own_name.sub(lambda word: prefix + word[0], code) for code in pieces[::2]]
    return "".join(pieces)


@dataclass(frozen=True, eq=False)
class _Part:
    """A function, table or macro of C source: its place with the comment before it, its words."""

    name: str
    begin: int
    end: int
    words: Counter[str]


def _parts(source: str) -> list[_Part]:
    """All parts that may be left out, none inside another."""
    parts, end = list[_Part](), 0
    matches = [
        (match, _NAME.findall(match[1].replace("__attribute__((", ""))[0])
        for match in _STATIC_FUNCTION.finditer(source)
    ]
    for pattern in (_STATIC_TABLE, _MACRO):
        matches += [(match, match[1]) for match in pattern.finditer(source)]
    for match, name in sorted(matches, key=lambda pair: pair[0].start()):
        if match.start() >= end:
            end = match.end()
            parts.append(_Part(name, match.start(), end, Counter(_words(match[0]))))
    return parts


def _words(source: str) -> list[str]:
    """Words of code that are not members of structures."""
    return _USED.findall(_COMMENT.sub(" ", source))


def _definitions(source: str) -> Iterator[tuple[str, str]]:
    """Names and texts of the functions and tables of generated source, in their order."""
    lines: list[str] = []
    has_body = False
    for line in source.splitlines(keepends=True):
        if not lines and not line[0].isalpha() and not line.startswith("_"):
            continue  # between definitions
        lines.append(line)
        has_body |= line.endswith("{\n")  # the head of a function may take several lines
        alone = not has_body and line.rstrip().endswith(("}", ";"))
        if line == "}\n" or alone:
            text, lines, has_body = "".join(lines), [], False
            yield _NAME.findall(text.replace("__attribute__((", ""))[0], text


def _reachable(definitions: Mapping[str, str], names: Sequence[str]) -> set[str]:
    """The definitions that some need, themselves included."""
    reached, left = set[str](), list(names)
    while left:
        if (name := left.pop()) not in reached:
            reached.add(name)
            left += definitions.keys() & set(_WORD.findall(definitions[name]))
    return reached


def _static(text: str) -> str:
    text = _OLD_C.sub(r"\1", text.removeprefix(_EXPORT))
    text = _FUNCTION.sub(_with_unused, text)
    for pattern, plain in _PLAIN:
        text = pattern.sub(plain, text)
    return text if text.startswith("static ") else f"static {text}"


def _with_unused(head: re.Match[str]) -> str:
    """The head of a function that says that some of its arguments may not be used."""
    names = (argument.split()[-1].lstrip("*") for argument in head[2].split(","))
    return f"{head[0]}  {', '.join(f'(void){name}' for name in names)};\n"


def c_string(text: str) -> str:
    """A text as a string literal in C, such as the name of a joint."""
    escapes = {"\\": "\\\\", '"': '\\"', "?": "\\?"}  # ?: trigraphs
    characters = (escapes.get(c) or (c if c >= " " else f"\\{ord(c):03o}") for c in text)
    return f'"{"".join(characters)}"'
