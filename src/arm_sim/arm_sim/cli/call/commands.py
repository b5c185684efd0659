# SPDX-License-Identifier: Apache-2.0
"""The commands of ``./arm call``, made from the table of services."""

from array import array
from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial
from typing import Any

import click

from arm_sim.cli.arguments import Json, Timeout
from arm_sim.cli.call.answers import Answer, print_json
from arm_sim.cli.call.services import DYNAMICS, MODEL_INFO, SERVICES, Field, Service
from arm_sim.cli.command import command, option_name
from arm_sim.cli.completion import Commands
from arm_sim.cli.output import examples, say
from arm_sim.cli.vectors import HOW, BitsType, Vector, VectorType, WordsType

Request = Mapping[Field, Any]
POINTS = '"[[…], […]]" for two points, or @FILE'


KINDS = {
    "float64": click.FLOAT, "string": click.STRING, "string[]": WordsType(),
    "uint8": click.IntRange(0, 2**8 - 1), "uint32": click.IntRange(0, 2**32 - 1),
}  # fmt: skip


def _command(service: Service) -> click.Command:
    """The command of a service."""
    name = service.command.replace("_", "-")

    def run(
        *, node: str = f"/{service.node}", timeout: Timeout = 5.0, as_json: Json = False, **options
    ) -> None:
        """Call a service and print the answer; fail if the node does not answer or refuses.

        Args:
            node: Name of the node, with its namespace.
            timeout: How long to wait, in s.
            as_json: Print JSON.
            options: The fields of the request.
        """
        from arm_dynamics.exceptions import NoAnswer, Refused
        from arm_dynamics.ros.common.caller import Caller, Silence

        request = {x: v for x in service.request if (v := options[x.name]) not in (None, "")}
        contents = [x for x in service.request if x.name != "joint_names"]
        if contents and not any(field in request for field in contents):
            raise click.UsageError(f"nothing to set: give {' or '.join(map(_option, contents))}")
        try:
            with closing(Caller(timeout)) as caller:
                _send_and_print(partial(_response, caller, node), service, node, request, as_json)
        except NoAnswer as error:
            start = f"\n  start one in another terminal: ./arm {service.node} SCENE"
            raise click.ClickException(
                f"{error}{'' if isinstance(error, Silence) else start}"
                "\n  --node selects another node, --timeout waits longer"
            ) from None
        except Refused as error:
            if not as_json:
                raise click.ClickException(f"refused: {error}") from None
            print_json(str(error))
            raise SystemExit(1) from None

    lines = (f"./arm call {name} {words}".strip() for words in service.examples.split("\n"))
    fields = sorted(service.request, key=lambda field: field.name == "joint_names")
    options = [_parameter(service, field) for field in fields]
    subcommand = command(*lines, name=name, first=options)(run)
    subcommand.help, subcommand.short_help = service.help, service.short_help
    return subcommand


def _option(field: Field) -> str:
    return "--joints" if field.name == "joint_names" else option_name(field.name)


def _parameter(service: Service, field: Field) -> click.Parameter:
    """The option of a field; an argument if the request has no other and is a number."""
    default, about = field.default.strip('"'), field.help
    if field.type == "bool":
        return click.Option([_option(field), field.name], is_flag=True, help=f"{about}.")
    if field.type == "uint8" and service.bits:
        kind = BitsType(service.bits)
        default = next((name for name, bit in service.bits.items() if str(bit) == default), "")
        about = f"Some of {', '.join(service.bits)}"
    else:
        kind = VectorType() if field.type.startswith("float64[") else KINDS[field.type]
        if field == next((x for x in service.request if x.shape), None):
            about += f"; {HOW if 'n' in field.shape else POINTS}"
    settings = {"type": kind} | ({"default": default} if default else {})
    if [field] == service.request and isinstance(kind, click.IntRange):
        return click.Argument([field.name], **settings)
    return click.Option(
        [_option(field), field.name], required=field.required, show_default=bool(default),
        help=f"{about}.", **settings,
    )  # fmt: skip


def _response(caller: Any, node: str, service: Service, **fields: Any) -> Any:
    """The response of a node; ``Refused`` if it has declined and answered nothing."""
    from arm_dynamics.exceptions import Refused
    from arm_dynamics.ros import interfaces

    row = getattr(interfaces, (service.name or service.command).upper())
    request = row.type.Request(**fields, **service.sends)
    response = caller.ask(node, row, request, repeatable=not service.once)
    arrays = (getattr(response, field.name) for field in service.response if field.shape)
    if not response.success and not any(map(len, arrays)):
        raise Refused(response.message)
    return response


def _send_and_print(
    ask: Callable[..., Any], service: Service, node: str, request: Request, as_json: bool
) -> None:
    """Send a request, and print the response."""
    joints = _joints(ask, service, request)
    sent = {field.name: _value(field, value, list(joints)) for field, value in request.items()}
    if any(field.name == "joint_names" for field in service.request):
        sent["joint_names"] = sent.get("joint_names") or list(joints)
    response = ask(service, **sent)
    vectors = {field: value for field, value in request.items() if isinstance(value, Vector)}
    answer = Answer(service, response, vectors, joints)
    if as_json:
        answer.print_json("" if response.success else response.message)
    elif service.outcome:  # numbers that were not sent are zero
        values = {field.name: 0 for field in service.request} | sent
        values |= {field.name: getattr(response, field.name) for field in service.response}
        values["joints"] = ", ".join(sent.get("joint_names", ())) or "all joints"
        say(f"/{node.strip('/')}: {service.outcome.format(**values)}")
    else:
        answer.print()
    if not response.success:  # a part of the request
        raise SystemExit(1) if as_json else click.ClickException(response.message)


def _joints(ask: Callable[..., Any], service: Service, request: Request) -> dict[str, str]:
    """Types of joints by name, in the order of the vectors; of a simulation those named."""
    names = next((value for field, value in request.items() if field.name == "joint_names"), [])
    if service.node == DYNAMICS:
        facts = ask(MODEL_INFO)
        kinds = dict(zip(facts.joint_names, facts.joint_types, strict=True))
        return {name: kinds.get(name, "") for name in names or kinds}
    for vector in (x for x in request.values() if isinstance(x, Vector) and x.named):
        if names and set(vector.named) != set(names):
            raise click.ClickException(
                f"joints {', '.join(vector.named)} and {', '.join(names)}; allowed: the same "
                "joints in every vector and in --joints"
            )
        names = names or list(vector.named)
    return dict.fromkeys(names, "")


def _value(field: Field, value: Any, joints: list[str]) -> Any:
    """The value of a field; vectors by name in the order of these joints."""
    if not isinstance(value, Vector):
        return value
    if value.named and "n" not in field.shape:
        raise click.ClickException(f"{_option(field)}: numbers without names are expected")
    if value.batch and "k" not in field.shape:
        raise click.ClickException(f"{_option(field)}: one row is expected, got several points")
    numbers = value.flat(joints)
    size = field.type[len("float64[") : -1]
    if size and len(numbers) != int(size):
        raise click.ClickException(f"{field.name} has {len(numbers)} numbers; expected {size}")
    return numbers if size else array("d", numbers)


_EXAMPLES = examples(
    './arm call inverse-dynamics --position "0 -0.8 0 -2.4 0 1.6 0.8"',
    './arm call inverse-dynamics --position "panda_joint4=-2.4" --terms gravity',
    "./arm call model-info --json",
)


@click.group(cls=Commands, commands=[*map(_command, SERVICES)], epilog=_EXAMPLES)
def call() -> None:
    """Call a service of a running node.

    Vectors are in model order, or by joint name; joints that are not named are zero. Start the
    nodes with ./arm dynamics SCENE and ./arm sim SCENE.
    """
