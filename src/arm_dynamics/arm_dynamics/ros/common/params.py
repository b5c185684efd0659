# SPDX-License-Identifier: Apache-2.0
"""Parameters as frozen dataclasses, declared with ranges, and changed atomically.

A field is a parameter if its metadata have a ``description``; a field that is a dataclass is a
group of parameters.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import field, fields, is_dataclass, replace
from functools import partial
from typing import Any

from rcl_interfaces import msg
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from arm_dynamics.exceptions import ArmError, InvalidInput, plain
from arm_dynamics.exceptions import choices as known_choices

SCENE = "Scene: name of a bundled one, scene file or URDF (path or package:// URI), or URDF text"
_NOTATION = {float: "a number", int: "a whole number, as in 5", bool: "true or false", str: "text"}


def parameter(
    default: Any, description: str, *, low: float | None = None, high: float | None = None,
    choices: tuple[str, ...] = (), read_only: bool = True, name: str | None = None,
) -> Any:  # fmt: skip
    """Describe one field of a parameter dataclass, whose type is that of the default.

    Allowed are values from ``low`` to ``high``, or some ``choices``. It is called ``name``, by
    default as the field.
    """
    about = {"description": description, "choices": choices, "read_only": read_only}
    if name is not None:
        about["parameter"] = name
    if low is not None:
        about |= {"low": low, "high": high}
    if isinstance(default, list):
        return field(default_factory=lambda: list(default), metadata=about)
    return field(default=default, metadata=about)


def declare[P](node: Node, kind: type[P]) -> P:
    """Declare the parameters of ``kind`` and read their values; 5 is accepted for 5.0.

    Raises:
        InvalidInput: If a value given at start is of a wrong type or not allowed.
    """
    overrides = node._parameter_overrides  # rclpy provides them in no other way
    if not node._pre_set_parameters_callbacks:  # with two, rclpy sets every parameter twice
        node.add_pre_set_parameters_callback(partial(_with_floats, node))

    def value_of(name: str, default: Any, about: Mapping[str, Any]) -> Any:
        default = _for_ros(default, about)
        if isinstance(default, float) and name in overrides:
            overrides[name] = _as_float(overrides[name])
        try:
            return node.declare_parameter(name, default, _descriptor(about, default)).value
        except InvalidParameterValueException as error:
            low, high = about.get("low", 0), about.get("high", 0)
            allowed = f"{low:.10g} to {high:.10g}" if "low" in about else str(error)
        except InvalidParameterTypeException:
            allowed = _NOTATION.get(type(default), "a list")
        raise InvalidInput(f"parameter '{name}' is {overrides[name].value!r}; allowed: {allowed}")

    return _with_values(kind(), value_of)


def _with_floats(node: Node, parameters: list[Parameter]) -> list[Parameter]:
    """The parameters to set, whole numbers as floats where those are expected, lists last."""

    def is_dynamic(p: Parameter) -> bool:
        return node.has_parameter(p.name) and node.describe_parameter(p.name).dynamic_typing

    return [
        _as_float(p) if node.get_parameter_or(p.name).type_ == Parameter.Type.DOUBLE else p
        for p in sorted(parameters, key=is_dynamic)  # as rclpy notes their new types at once
    ]


def _as_float(p: Parameter) -> Parameter:
    return Parameter(p.name, value=float(p.value)) if p.type_ == Parameter.Type.INTEGER else p


def listed(params: object) -> Iterator[tuple[str, Any, Mapping[str, Any]]]:
    """Names, values and metadata of parameters, in order; of a type its defaults."""
    instance = params() if isinstance(params, type) else params
    for item in fields(instance):  # type: ignore[arg-type]
        value, about = getattr(instance, item.name), item.metadata
        if is_dataclass(value):
            yield from listed(value)
        elif "description" in about:
            yield about.get("parameter", item.name), value, about


def watch[P](
    node: Node, present: P, apply: Callable[[P], None], always_apply: Collection[str] = ()
) -> Callable[[P], None]:
    """Apply changes at run time: all parameters of a request together, or none of them.

    Args:
        node: The node that declared the parameters.
        present: The current dataclass.
        apply: Applies a new one; with an ``ArmError`` it refuses the request, and must keep the
            old one.
        always_apply: Names of parameters that are applied even if they are set to what they are,
            as something else may have replaced what they gave.

    Returns:
        A function that sets the parameters back to earlier ones, without applying those: for what
        turns out to be unusable only after a request was accepted. Any thread may call it.
    """

    def on_set(parameters: list[Parameter]) -> msg.SetParametersResult:
        nonlocal present
        before, values = present, {p.name: p.value for p in parameters}
        try:
            after = _with_values(before, lambda name, value, about: values.get(name, value))
            if after != before or values.keys() & set(always_apply):
                present = after  # first, as it may be set back at once
                apply(after)
        except ArmError as error:
            present = before
            for p in parameters:  # rclpy has noted the types of what is refused
                node._descriptors[p.name].type = node.get_parameter(p.name).type_.value
            return msg.SetParametersResult(reason=plain(error))  # not successful
        return msg.SetParametersResult(successful=True)

    def write_back() -> None:
        """Let the node have the present values."""
        stale = [
            Parameter(name, value=_for_ros(value, about))
            for name, value, about in listed(present)
            if _convert(name, node.get_parameter(name).value, value, about) != value
        ]
        if stale:
            node.set_parameters_atomically(stale)

    def restore(former: P) -> None:
        """Make earlier parameters the present ones."""
        nonlocal present
        present = former
        if node.executor is None:
            write_back()
        else:  # not within a request, which ends by setting what it was accepted for
            node.executor.create_task(write_back)

    node.add_on_set_parameters_callback(on_set)
    return restore


def _for_ros(value: Any, about: Mapping[str, Any]) -> Any:
    """A parameter's value as ROS has it."""
    if about.get("each_joint") and not isinstance(value, list):
        return [value]
    return list(value) if isinstance(value, tuple) else value


def _with_values[P](params: P, value_of: Callable[[str, Any, Mapping[str, Any]], Any]) -> P:
    """The dataclass with other values, checked by name, current value and metadata."""
    changes: dict[str, Any] = {}
    for item in fields(params):  # type: ignore[arg-type]
        present, about = getattr(params, item.name), item.metadata
        if is_dataclass(present):
            changes[item.name] = _with_values(present, value_of)
        elif "description" in about:
            name = about.get("parameter", item.name)
            changes[item.name] = _convert(name, value_of(name, present, about), present, about)
    return replace(params, **changes)  # type: ignore[type-var]


def _convert(name: str, value: Any, present: Any, about: Mapping[str, Any]) -> Any:
    """A value in the type of the present one; a number is accepted for a list."""
    if value is None:
        raise InvalidInput(f"parameter '{name}' has no value; a parameter cannot be removed")
    allowed = about.get("choices")
    if allowed and value not in allowed:
        raise InvalidInput(
            f"parameter '{name}' is '{value}'; allowed: one of {known_choices(value, allowed)}"
        )
    if not (about.get("each_joint") or isinstance(present, list | tuple)):
        return value
    values = [value] if isinstance(value, bool | int | float | str) else list(value)
    if any(isinstance(x, bool) for x in values) and not isinstance(present, bool):
        raise InvalidInput(f"parameter '{name}' is {value}; numbers are expected")
    if about.get("each_joint"):  # as the core expects them
        return values[0] if len(values) == 1 else values
    return type(present)(values)


def _descriptor(about: Mapping[str, Any], default: Any) -> msg.ParameterDescriptor:
    descriptor = msg.ParameterDescriptor(
        description=about["description"],
        read_only=about.get("read_only", False),
        dynamic_typing=isinstance(default, list),  # [30] and 30 are equivalent to [30.0]
    )
    if allowed := about.get("choices"):
        descriptor.additional_constraints = "one of " + ", ".join(allowed)
    if "low" in about:
        low, high = about["low"], about["high"]
        if isinstance(default, int):
            descriptor.integer_range = [msg.IntegerRange(from_value=int(low), to_value=int(high))]
        else:
            span = msg.FloatingPointRange(from_value=low, to_value=high)
            descriptor.floating_point_range = [span]
    return descriptor
