"""An option without effect, and a file whose ending is another format's, are refused: every rule of every command.

The rules are those that the options declare, so a new one is tested too. What only a command can know is in
test_mistakes.py.
"""

from __future__ import annotations

from functools import cache
from typing import Literal, get_args, get_origin

import pytest
import typer
from test_wrong_arguments import CALLS, PROGRAMS

from raff2urdf.command_line import ENDINGS, FOLDER, UsageError

SHORT = CALLS | {"cinegen map": "planar_3r.raff", "raff2urdf": "four_bar.raff"}
"""Calls with nothing that another option may exclude."""

OUTPUTS = {
    "output", "plot", "plot_joints", "poses", "record", "report", "snapshot", "state", "video",
}  # fmt: skip
BY_FORMAT = {("cinegen export", "--output"), ("raff2urdf", "--output")}
"""Outputs whose ending another option determines."""


@cache
def command_of(call: str):
    program, *names = call.split()
    found = typer.main.get_command(PROGRAMS[program].app)
    for name in names:
        found = found.commands[name]
    return found


def options_of(call: str):
    """The options of a command by their names."""
    return {max(one.opts, key=len): one for one in command_of(call).params if one.param_type_name == "option"}


def rules_of(call: str):
    by_parameter = command_of(call).callback.rules
    return {name: by_parameter[one.name] for name, one in options_of(call).items() if one.name in by_parameter}


def choices_of(annotation: object) -> list[str]:
    """The values of a `Literal`, optional or not."""
    if get_origin(annotation) is Literal:
        return list(get_args(annotation))
    return [choice for part in get_args(annotation) for choice in choices_of(part)]


def typed(call: str, wanted: str, endings: tuple[str, ...] = ()) -> list[str]:
    """An option as it is typed, with a value that can be parsed: `--format sdf` and `--plot` alike."""
    name, _, value = wanted.partition(" ")
    option = options_of(call)[name]
    if option.is_flag:
        return [name]
    choices = choices_of(option.type_descriptor.annotation)
    return [name, value or (choices[-1] if choices else f"1{endings[0]}" if endings else "1")]


def parse(call: str, *words: str) -> None:
    command_of(call).make_context(call, [*SHORT[call].split(), *words])


def there(call: str, options: tuple[str, ...]) -> list[str]:
    return [one for one in options if one.partition(" ")[0] in options_of(call)]


def needed(call: str, name: str) -> list[str]:
    """What an option needs, and what that needs, as it is typed."""
    needs = there(call, rules_of(call)[name].needs) if name in rules_of(call) else []
    are_default = [f"{one} {option.default}" in needs for one, option in options_of(call).items()]
    return with_needs(call, needs[0]) if needs and not any(are_default) else []


def with_needs(call: str, wanted: str) -> list[str]:
    """An option as it is typed, with what it needs."""
    name = wanted.partition(" ")[0]
    rules = rules_of(call).get(name)
    return [*needed(call, name), *typed(call, wanted, rules.endings if rules else ())]


NEEDS = [(call, name) for call in CALLS for name, rules in rules_of(call).items() if there(call, rules.needs)]
UNLESS = [
    (call, name, one) for call in CALLS for name, rules in rules_of(call).items() for one in there(call, rules.unless)
]
WRITTEN = [(call, name) for call in CALLS for name, rules in rules_of(call).items() if rules.endings]


@pytest.mark.parametrize(("call", "name"), NEEDS)
def test_an_option_without_the_one_that_it_needs_is_refused(call, name):
    rules = rules_of(call)[name]
    needs, endings = there(call, rules.needs), rules.endings
    none = []
    for one in needs:
        option = options_of(call)[one.partition(" ")[0]]
        if " " in one:
            none += [
                option.opts[0],
                next(c for c in choices_of(option.type_descriptor.annotation) if f"{option.opts[0]} {c}" not in needs),
            ]
        elif option.default:
            none += [option.opts[0], "0"]
    with pytest.raises(UsageError) as raised:
        parse(call, *none, *typed(call, name, endings))
    assert str(raised.value).startswith(f"{name} has no effect without {' or '.join(needs)}: add ")
    for one in needs:
        parse(call, *with_needs(call, one), *typed(call, name, endings))  # the remedy


@pytest.mark.parametrize(("call", "name", "other"), UNLESS)
def test_an_option_with_one_that_excludes_it_is_refused(call, name, other):
    words = typed(call, name, rules_of(call)[name].endings)
    more = needed(call, name)
    if other.partition(" ")[0] not in more:
        more += typed(call, other, rules_of(call)[other].endings if other in rules_of(call) else ())
    with pytest.raises(UsageError) as raised:
        parse(call, *more, *words)
    assert str(raised.value) == f"{name} has no effect with {other}: leave one out"


@pytest.mark.parametrize(("call", "name"), WRITTEN)
def test_an_ending_of_another_format_is_refused(call, name):
    endings = rules_of(call)[name].endings
    more = needed(call, name)
    for other in sorted(ENDINGS - set(endings)):
        with pytest.raises(UsageError) as raised:
            parse(call, *more, name, f"some/file{other}")
        assert str(raised.value).startswith(
            f"{name} some/file{other}: {other} is another format's ending, {name} writes"
        )
        remedy = f"name some/file{endings[0]}"
        assert remedy in str(raised.value)
    for right in ("" if endings == FOLDER else endings[-1].upper(), "", ".2026-11-28", endings[0]):
        parse(call, *more, name, f"some/file{right}")
    parse(call, *more, name, "-")


def test_every_output_declares_its_endings():
    found = {(call, name) for call in CALLS for name, one in options_of(call).items() if one.name in OUTPUTS}
    assert found - set(WRITTEN) == BY_FORMAT
