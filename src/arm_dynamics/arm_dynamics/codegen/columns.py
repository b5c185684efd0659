# SPDX-License-Identifier: Apache-2.0
"""C for functions that are linear in columns, several columns side by side in a vector register.

The coefficients of a column are scalars, which are written once for all columns.
"""

from collections.abc import Callable

import casadi as ca

_BINARY = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_UNARY: dict[int, Callable[[str], str]] = {
    ca.OP_ASSIGN: "{}".format,
    ca.OP_NEG: "-{}".format,
    ca.OP_TWICE: "2.0 * {}".format,
    ca.OP_INV: "1.0 / {}".format,
    ca.OP_SQ: "{0} * {0}".format,
}


def column_function(function: ca.Function) -> str:
    """C code of a function of coefficients, the first argument, and of columns, the others.

    The code expects ``native/columns.h``.

    Args:
        function: A CasADi function of scalar expressions with one dense result.

    Returns:
        A function ``void NAME(const real* c, const column* const* arg, column* res)``.
    """
    lines, scalars, declared = list[str](), set[int](), set[str]()

    def name(work: int) -> str:
        return f"{'n' if work in scalars else 'a'}{work}"

    for k in range(function.n_instructions()):
        kind = function.instruction_id(k)
        outputs, inputs = function.instruction_output(k), function.instruction_input(k)
        if kind == ca.OP_OUTPUT:
            value = name(inputs[0])
            spread = f"SPREAD({value})" if inputs[0] in scalars else value
            lines.append(f"res[{outputs[1]}] = {spread};")
            continue
        is_scalar = all(i in scalars for i in inputs)
        if kind == ca.OP_CONST:
            value = repr(function.instruction_constant(k))
        elif kind == ca.OP_INPUT:
            argument, element = inputs
            is_scalar = argument == 0
            value = f"c[{element}]" if is_scalar else f"arg[{argument - 1}][{element}]"
        elif kind in _BINARY:
            value = f" {_BINARY[kind]} ".join(map(name, inputs))
        elif kind in _UNARY:
            value = _UNARY[kind](name(inputs[0]))
        else:
            raise ValueError(f"no operation of linear functions: CasADi's number {kind}")
        (scalars.add if is_scalar else scalars.discard)(outputs[0])
        declared.add(f"{'real n' if is_scalar else 'column a'}{outputs[0]};")
        lines.append(f"{name(outputs[0])} = {value};")
    body = "\n  ".join([*sorted(declared), "(void)c, (void)arg;", *lines])
    # Inlined into a loop, it would share the vector registers with what surrounds it.
    head = f"static __attribute__((noinline)) void {function.name()}"
    return f"{head}(const real* c, const column* const* arg, column* res) {{\n  {body}\n}}\n"
