"""The conventions of all command lines: suggestions, exit codes, version, completion, colours, groups of options."""

from dataclasses import dataclass
from typing import Annotated

import pytest
import typer

from raff2urdf.command.command_line import VERSION, Command, expand, new_app, ruled, run_app
from raff2urdf.command.output import run
from raff2urdf.version import __version__


@dataclass(frozen=True)
class Lengths:
    width: Annotated[float, typer.Option(min=0.0, help="width, m")] = 1.0
    name: Annotated[str | None, typer.Option("-n", "--name", metavar="NAME", help="of it")] = None
    plot: Annotated[str | None, ruled(typer.Option(), endings=(".png", ".svg"))] = None
    title: Annotated[str | None, ruled(typer.Option(), needs="--plot, --name x")] = None
    quiet: Annotated[bool, ruled(typer.Option("--quiet"), unless="--plot")] = False


def draw(files: Annotated[list[str], typer.Argument(metavar="FILE", help="file")], lengths: Lengths) -> int:
    """Draw files."""
    print(files, lengths.width, lengths.name)
    return 0 if lengths.name else 1


def main(version: bool = VERSION) -> None:
    """Draw and delete."""


@pytest.fixture
def typed(capsys):
    """`typed("draw", "a.txt")`: exit code, standard output, standard error."""
    app = new_app(no_args_is_help=True)
    app.callback()(main)
    app.command("draw", cls=Command)(expand(draw))
    app.command("delete")(expand(draw))

    def call(*arguments):
        return run("thing", lambda: run_app(app, "thing", arguments)), *capsys.readouterr()

    return call


def test_the_fields_of_a_dataclass_are_options(typed):
    assert typed("draw", "a", "b") == (1, "['a', 'b'] 1.0 None\n", "")
    assert typed("draw", "a", "--width", "2", "-n", "x") == (0, "['a'] 2.0 x\n", "")
    for more in (["--title", "t"], ["--title", "t", "--plot", "p.SVG"], ["--quiet"], ["--plot", "p.2026-11-28"]):
        assert typed("draw", "a", "-n", "x", *more)[0] == 0


@pytest.mark.parametrize(("arguments", "says"), [
    (("darw", "a"), "thing: unknown command 'darw' (did you mean 'draw'?)\nTry 'thing --help'."),
    (("draw", "--wdith", "1"), "thing draw: unknown option '--wdith' (did you mean '--width'?)"),
    (("draw",), "thing draw: missing argument 'FILE'"),
    (("draw", "a", "--width", "wide"), "thing draw: invalid value for '--width'"),
    (("draw", "a", "--title", "t", "-n", "y"), "thing draw: --title has no effect without --plot or"),
])  # fmt: skip
def test_a_wrong_call_is_reported_in_two_lines_with_exit_code_2(typed, arguments, says):
    code, out, err = typed(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith(says)
    assert len(err.splitlines()) == 2


def test_a_group_without_a_command_shows_its_help(typed):
    code, out, err = typed()
    assert (code, err) == (2, "")
    assert "Draw and delete." in out
    assert "delete" in out


def test_the_version_is_that_of_the_distribution(typed):
    assert typed("--version") == (0, f"{__version__}\n", "")


@pytest.mark.parametrize("words", [("help",), ("help", "draw"), ("help", "darw")])
def test_help_is_a_command_and_an_option(typed, words):
    assert typed(*words)[1:] == typed(*words[1:], "--help")[1:]
    assert typed("help", "help")[1:] == typed("--help")[1:]
    assert "help takes the name of one command, not 2" in typed("help", "draw", "draw")[2]
