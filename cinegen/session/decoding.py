"""Read and check commands, and messages of pages."""

from __future__ import annotations

from collections.abc import Collection
from typing import TypeVar

import msgspec

from cinegen.ik.joint_settings import names_of
from cinegen.ik.tasks.described import unknown_name
from cinegen.model import Mechanism
from cinegen.session.commands import AddTask, ChangeSensor, Command, LockJoint
from cinegen.session.message_types import LONGEST, CommandError, TypedMessage
from cinegen.session.setup import Setup
from raff2urdf.errors import raised_as

_Message = TypeVar("_Message")


def check_names(command: TypedMessage, setup: Setup) -> None:
    """Check the names in a command to a session. The only node of an obstacle has its name.

    Raises:
        CommandError: one of them does not exist; the message names the field.
    """
    robot = getattr(command, "robot", None)
    if isinstance(command, ChangeSensor) and command.sensor not in [d.name for d in setup.devices if d.has_axes]:
        raise CommandError(f"Unknown sensor {command.sensor!r:.80} - at `$.sensor`")
    if robot is None:
        return
    if isinstance(command, AddTask):
        _check_described(command, setup)
        return
    mechanism, switch = setup.robots.get(robot), (robot, getattr(command, "node", ""))
    known: dict[str, Collection[str | None]] = {
        "robot": (*setup.robots, *setup.obstacles),
        "node": (robot,) if mechanism is None else mechanism.nodes,
        "joint": () if mechanism is None else _joints_of(command, mechanism),
        "sensor": next((s.choices for s in setup.switches if (s.robot, s.node) == switch), ()),
    }
    for name in command.__struct_fields__:
        value = getattr(command, name)
        if name in known and value not in known[name]:
            raise CommandError(f"Unknown {name} {value!r:.80} - at `$.{name}`")


def _check_described(command: AddTask, setup: Setup) -> None:
    mechanism = setup.robots.get(command.robot)
    if mechanism is None:
        raise CommandError(f"Unknown robot {command.robot!r:.80} - at `$.robot`")
    unknown = unknown_name(command.description, mechanism.nodes, mechanism.joints)
    if unknown is not None:
        raise CommandError(f"Unknown {unknown[0]} {unknown[1]!r:.80} - at `$.description.{unknown[2]}`")


def _joints_of(command: TypedMessage, mechanism: Mechanism) -> Collection[str]:
    return (*names_of(mechanism), "base") if isinstance(command, LockJoint) else mechanism.actuated


def decode(message: str | bytes, decoder: msgspec.json.Decoder[_Message]) -> _Message:
    """Decode a message from a browser or a program.

    Raises:
        CommandError: it is no text, too long, no JSON, or doesn't match the schema; the message names the field.
    """
    if not isinstance(message, str):
        raise CommandError("a message must be text, not binary")
    if len(message) > LONGEST:
        raise CommandError(f"a message must not be longer than {LONGEST} characters")
    with raised_as(CommandError, (msgspec.MsgspecError, RecursionError, UnicodeError)):
        return decoder.decode(message)


_COMMANDS: msgspec.json.Decoder[Command] = msgspec.json.Decoder(Command)


def decode_command(message: str | bytes, setup: Setup) -> Command:
    """Decode a command and check the names in it.

    Raises:
        CommandError: see `decode` and `check_names`.
    """
    command = decode(message, _COMMANDS)
    check_names(command, setup)
    return command
