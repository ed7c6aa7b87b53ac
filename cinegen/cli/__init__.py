"""The command `cinegen`: a module for each of its commands, imported without anything that computes."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from contextvars import copy_context
from importlib import import_module

from cinegen.cli.numbers import NumberLists
from cinegen.errors import CinegenError
from raff2urdf.command import output
from raff2urdf.command.command_line import VERSION, expand, new_app, print_error, run_app
from raff2urdf.errors import RaffError

COMMANDS = (
    *("robots.demo", "robots.info", "motion.ik", "study.modes", "study.singular", "study.forces", "design.synthesize"),
    *("design.tolerance", "design.calibrate", "study.map", "study.compare", "study.prove", "study.check-proof"),
    *("motion.plan", "motion.drive", "motion.replay", "exports.export", "exports.generate", "exports.page"),
    *("robots.close", "robots.heal", "robots.validate", "motion.sensors", "robots.compile"),
)
"""Groups and names of the commands, and of their modules, in the order of the help."""

app = new_app(
    no_args_is_help=True,
    help="Kinematics of serial, tree and closed-loop mechanisms described in RAFF, URDF, SDF or MJCF.",
    epilog="cinegen help COMMAND explains one. Exit codes: 0 done; 1 bad input, or the answer is no; 2 a wrong call.",
)
for _path in COMMANDS:
    _command = import_module(f"cinegen.cli.{_path.replace('-', '_')}").run
    app.command(_path.partition(".")[2], cls=NumberLists)(expand(_command))


@app.callback()
def _options(version: bool = VERSION) -> None:
    pass


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code: 0, 1 or 2, or as `raff2urdf.command.output.run` returns."""
    return output.run("cinegen", lambda: copy_context().run(_main, arguments))


def _main(arguments: Sequence[str] | None) -> int:
    shown = set[str]()

    def show(message: Warning | str, *_: object, **__: object) -> None:
        if str(message) not in shown:  # shapes that are drawn and checked lack the same mesh
            shown.add(str(message))
            print(f"warning: {message}", file=sys.stderr)

    with warnings.catch_warnings():
        # of other packages' modules, when Python compiles them; a SyntaxWarning from Python 3.12 on
        warnings.filterwarnings("ignore", "invalid escape sequence")
        warnings.showwarning = show
        try:
            return run_app(app, "cinegen", arguments)
        except (RaffError, CinegenError) as error:
            print_error(f"cinegen: {error}")
        except UnicodeEncodeError as error:  # bytes of a file's name
            print(f"cinegen: '{error.object}' is not valid UTF-8: rename the file", file=sys.stderr)
        return 1
