"""Command lines by Typer: one style of help and errors, suggestions for mistyped names, exit codes 0, 1 and 2.

A command is a function whose parameters are its arguments and options, and which returns its exit code. Options that
several commands share are the fields of a dataclass: `expand` makes one option of each field. An option may have
`Rules`: `Command` refuses a call in which it would have no effect, or would write a file under another format's ending.
"""

from __future__ import annotations

import contextlib
import inspect
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup
from typer.exceptions import TyperException

from raff2urdf.command.output import STOPPED, unescaped
from raff2urdf.errors import near_names, raised_as, shortened
from raff2urdf.escape import terminal
from raff2urdf.quantities import Dimension, QuantityError, parse


class UsageError(TyperException):
    """A wrong call, found by a command itself; its exit code is 2."""

    exit_code = 2


ENDINGS = frozenset((
    ".c", ".csv", ".dae", ".eps", ".gif", ".h", ".htm", ".html", ".jpeg", ".jpg", ".js", ".json", ".jsonl", ".mjcf",
    ".mp4", ".npz", ".obj", ".pdf", ".png", ".py", ".raff", ".script", ".sdf", ".stl", ".svg", ".tif", ".tiff", ".toml",
    ".urdf", ".webm", ".webp", ".xacro", ".xml", ".yaml", ".yml", ".zarr",
))  # fmt: skip
"""Endings of the formats that commands read or write: each stands for its format, other endings for none."""

FOLDER = ("/",)
"""Endings of an option that names a folder."""


@dataclass(frozen=True)
class Rules:
    """Rules of an option.

    Attributes:
        needs: options without any of which it has no effect, such as `--over`, or `--format sdf`, one with this value.
            Those that a command lacks don't count.
        unless: options, likewise, with which it has no effect; `--json but --plot` does not count with `--plot`.
        endings: of the file that it writes, the usual one first; or `FOLDER`.
    """

    needs: tuple[str, ...] = ()
    unless: tuple[str, ...] = ()
    endings: tuple[str, ...] = ()


def ruled(option: Any, needs: str = "", unless: str = "", endings: tuple[str, ...] = ()) -> Any:
    """Return an option of Typer with `Rules`; `needs` and `unless` are separated by commas."""
    needed, excluded = (tuple(filter(None, text.split(", "))) for text in (needs, unless))
    option.rules = Rules(needed, excluded, endings)
    return option


def option(
    metavar: str | None, help: str, default: object = None, *names: str,
    needs: str = "", unless: str = "", endings: tuple[str, ...] = (), **settings: Any,
) -> Any:  # fmt: skip
    """Return an option with a value; further settings are those of `typer.Option`.

    Args:
        metavar: the value in the help; None lists the choices of a `Literal`.
        help: what it does, with the unit of a number.
        default: shown in the help unless it is empty.
        names: such as `-o`, `--output`; `--parameter` unless given.
        needs: options without which it has no effect, see `raff2urdf.command.command_line.Rules`.
        unless: options with which it has no effect.
        endings: of the file that it writes.
        settings: those of `typer.Option`.
    """
    info = typer.Option(default, *names, metavar=metavar, help=help, show_default=bool(default), **settings)
    return ruled(info, needs, unless, endings)


def flag(name: str, help: str, needs: str = "", unless: str = "", **settings: Any) -> Any:
    """Return an option without a value; `needs`, `unless` and further settings are those of `option`."""
    return ruled(typer.Option(False, name, metavar="", help=help, **settings), needs, unless)


def no_effect(where: str, *names: str, remedy: str = "leave it out") -> None:
    """Refuse options that have no effect in a case that only the command knows.

    Args:
        where: the case, such as "for a recording".
        names: of options or arguments, such as `--node`.
        remedy: what to do, behind the options' names.

    Raises:
        UsageError: one was given.
    """
    typed = [name for name in names if name in _GIVEN.get()]
    if typed:
        raise UsageError(f"{' and '.join(typed)} {_verb(typed)} no effect {where}: {remedy}")


def check_ending(name: str, value: object, endings: tuple[str, ...], others: Mapping[str, Rules] | None = None) -> None:
    """Refuse an output whose ending is another format's.

    Args:
        name: of the option.
        value: the path.
        endings: of the format.
        others: rules of the command's options, to name one that writes that format.

    Raises:
        UsageError: the ending is one of `ENDINGS`, and none of the format's.
    """
    path = Path(str(value))
    suffix = path.suffix.lower()
    if suffix not in ENDINGS or suffix in endings or str(value).endswith("/") or path.is_dir():
        return
    writes = "a folder: name" if endings == FOLDER else f"{' or '.join(endings)}: name"
    other = next((f", or write {key} {path}" for key, rules in (others or {}).items() if suffix in rules.endings), "")
    better = f"{path.with_suffix('')}{endings[0]}"
    raise UsageError(f"{name} {path}: {suffix} is another format's ending, {name} writes {writes} {better}{other}")


_GIVEN: ContextVar[frozenset[str]] = ContextVar("given", default=frozenset())
"""Names of the options and arguments that were typed."""


class _ColouredHelp:
    """A command or a group whose help has colours."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        with contextlib.redirect_stdout(unescaped(sys.stdout)):
            super().format_help(ctx, formatter)  # type: ignore[misc]


class Command(_ColouredHelp, TyperCommand):
    """A command that checks the `Rules` of its options."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command line; refuse options without effect, and endings of other formats."""
        left = super().parse_args(ctx, args)
        names = {parameter.name: _shown_name(parameter) for parameter in self.params if parameter.name}
        known = {name: ctx.params.get(key) for key, name in names.items()}
        typed = [key for key in names if getattr(ctx.get_parameter_source(key), "name", "") == "COMMANDLINE"]
        _GIVEN.set(frozenset(names[key] for key in typed))
        rules: dict[str, Rules] = getattr(self.callback, "rules", {})
        by_name = {names[key]: rule for key, rule in rules.items()}

        def active(wanted: str) -> bool:
            wanted, _, others = wanted.partition(" but ")
            name, _, value = wanted.partition(" ")
            return (known[name] == value if value else bool(known[name])) and not any(map(known.get, others.split()))

        def known_only(options: Iterable[str]) -> list[str]:
            return [wanted for wanted in options if wanted.partition(" ")[0] in known]

        for name in (names[key] for key in typed if key in rules):
            needs, unless = known_only(by_name[name].needs), known_only(by_name[name].unless)
            if needs and not any(map(active, needs)):
                raise UsageError(
                    f"{name} has no effect without {' or '.join(needs)}: add {_pronoun(needs)}, or leave it out"
                )
            for option in filter(active, unless):
                raise UsageError(f"{name} has no effect with {option.partition(' but ')[0]}: leave one out")
            if by_name[name].endings:
                check_ending(name, known[name], by_name[name].endings, by_name)
        return left


def _shown_name(parameter: Any) -> str:
    is_argument = parameter.param_type_name == "argument"
    return str(parameter.metavar or parameter.name) if is_argument else max(parameter.opts, key=len)


def _verb(names: Sequence[str]) -> str:
    return "has" if len(names) == 1 else "have"


def _pronoun(names: Sequence[str]) -> str:
    return "that" if len(names) == 1 else "one"


class Commands(_ColouredHelp, TyperGroup):
    """A group of commands that suggests a name where it has no command of the name that was typed."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command line; `help NAME` is `NAME --help`."""
        if args[:1] == ["help"]:
            if len(args) > 2:
                ctx.fail(f"help takes the name of one command, not {len(args) - 1}")
            args = [*(name for name in args[1:] if name != "help"), "--help"]
        return super().parse_args(ctx, args)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the name of the command, the command, and its arguments."""
        if args[0] not in self.commands:
            meant = _suggestion(args[0], list(self.commands))
            for name, command in self.commands.items() if Path(args[0]).suffix else ():
                if any(parameter.name in ("file", "files") for parameter in command.params):
                    meant = f" (did you mean '{name} {args[0]}'?)"
                    break
            ctx.fail(f"unknown command '{args[0]}'{meant}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the command; errors know which one that was."""
        try:
            return super().invoke(ctx)
        except TyperException as error:
            error.__dict__["command"] = ctx.invoked_subcommand
            raise


def new_app(**settings: Any) -> typer.Typer:
    """Return an app with `-h` for `--help` and without Typer's tracebacks; settings are those of `typer.Typer`."""
    names = {"help_option_names": ["-h", "--help"]}
    return typer.Typer(cls=Commands, context_settings=names, pretty_exceptions_enable=False, **settings)


def run_app(app: typer.Typer, program: str, arguments: Sequence[str] | None = None) -> int:
    """Run a command line; return its exit code.

    A wrong call is reported on standard error in two lines; its exit code is 2.

    Args:
        app: the command or commands.
        program: its name, for messages.
        arguments: the words after the name; those of this process unless given.

    Raises:
        KeyboardInterrupt: Ctrl-C.
        SystemExit: a shell asked for completions.
    """
    try:
        code: int | None = typer.main.get_command(app).main(arguments, prog_name=program, standalone_mode=False)
    except TyperException as error:
        if message := _message(error):  # none if help was shown instead
            path = " ".join(filter(None, [program, getattr(error, "command", None)]))
            print_error(f"{path}: {message}\nTry '{path} --help'.")
        return error.exit_code
    if code == STOPPED:  # Typer makes an exit code of Ctrl-C
        raise KeyboardInterrupt
    return code or 0


def print_error(text: str) -> None:
    """Print an error on standard error: at a terminal, its position in red, unless `NO_COLOR` is set."""
    text = "\n".join(map(shortened, text.split("\n")))
    if sys.stderr.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb":
        place, colon, rest = terminal(text).partition(": ")
        text = f"\x1b[1;31m{place}{colon}\x1b[0m{rest}"
        print(text, file=unescaped(sys.stderr))
    else:
        print(text, file=sys.stderr)


def expand(function: Callable[..., int]) -> Callable[..., int]:
    """Return a function for Typer that has one option for each field of the dataclasses that `function` takes."""
    hints = get_type_hints(function, include_extras=True)
    groups: dict[str, type[Any]] = {
        name: hint for name, hint in hints.items() if isinstance(hint, type) and is_dataclass(hint)
    }
    parameters: list[inspect.Parameter] = []
    rules: dict[str, Rules] = {}
    for name, parameter in inspect.signature(function).parameters.items():
        group = groups.get(name)
        members = {name: parameter} if group is None else inspect.signature(group).parameters
        types = hints if group is None else get_type_hints(group, include_extras=True)
        parameters += [
            p.replace(annotation=types[key], kind=inspect.Parameter.KEYWORD_ONLY) for key, p in members.items()
        ]
        for key, member in members.items():
            for info in (member.default, *getattr(types[key], "__metadata__", ())):
                if isinstance(declared := getattr(info, "rules", None), Rules):
                    rules[key] = declared

    def command(**values: Any) -> int:
        for name, group in groups.items():
            values[name] = group(**{field.name: values.pop(field.name) for field in fields(group)})
        return function(**values)

    paragraphs = inspect.cleandoc(function.__doc__ or "").split("\n\n")
    command.__doc__ = "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)  # as wide as the terminal
    command.rules = rules  # type: ignore[attr-defined]
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return command


def quantity_parser(dimension: Dimension, least: float, most: float) -> Callable[[Any], float]:
    """Return the parser of an option whose value is a number with an optional unit, in SI units and radians.

    Args:
        dimension: of the number.
        least: smallest valid value.
        most: largest valid value.
    """

    def parser(typed: Any) -> float:
        if not isinstance(typed, str):  # a default
            return float(typed)
        with raised_as(typer.BadParameter, QuantityError):
            value = parse(typed, dimension)
        if not least <= value <= most:
            raise typer.BadParameter(
                f"'{typed}' is not in the range {least:g} to {most:g} {dimension.default}".rstrip()
            )
        return value

    return parser


def quantity_option(
    metavar: str, help: str, dimension: Dimension, default: float | None = None, *names: str,
    least: float = 0.0, most: float = 1e7, needs: str = "", unless: str = "", **settings: Any,
) -> Any:  # fmt: skip
    """Return an option whose value is one number with an optional unit, SI units and radians.

    Args:
        metavar: the value in the help.
        help: what it does, with the unit of a bare number.
        dimension: of the number.
        default: in SI units; shown in the help unless it is None.
        names: such as `-o`, `--output`; `--parameter` unless given.
        least: smallest valid value.
        most: largest valid value.
        needs: options without which it has no effect, see `raff2urdf.command.command_line.Rules`.
        unless: options with which it has no effect.
        settings: those of `typer.Option`.
    """
    info = typer.Option(
        default, *names, metavar=metavar, help=help, show_default=default is not None,
        parser=quantity_parser(dimension, least, most), **settings,
    )  # fmt: skip
    return ruled(info, needs, unless)


def _show_version(wanted: bool) -> None:
    if wanted:
        from raff2urdf.version import __version__

        print(__version__)
        raise typer.Exit


VERSION = flag("--version", "Show the version and exit.", is_eager=True, callback=_show_version)
"""The option `--version`."""


def _suggestion(word: str, known: Sequence[str]) -> str:
    near = "' or '".join(near_names(word, known))
    return f" (did you mean '{near}'?)" if near else ""


def _message(error: TyperException) -> str:
    """Return an error as a sentence without its full stop."""
    if hasattr(error, "possibilities"):  # Typer's error of an unknown option
        name = getattr(error, "option_name", "")
        return f"unknown option '{name}'{_suggestion(name, error.possibilities or ())}"
    text = error.format_message().replace("Value error, ", "").strip().removesuffix(".")
    if choice := re.search(r": '(.*)' is not one of (.*)$", text):
        text += _suggestion(choice[1], re.findall(r"'([^']*)'", choice[2]))
    return text if text[1:2].isupper() else text[:1].lower() + text[1:]
