"""Expand xacro, the macro language for URDFs, by the package of that name, if it is installed. ROS is not needed:
`$(find PACKAGE)` is searched as `package://` is."""

from __future__ import annotations

import contextlib
import io
import threading
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from lxml import etree

from raff2urdf.command.extras import needs
from raff2urdf.errors import RaffError
from raff2urdf.escape import shell_word
from raff2urdf.files import LARGEST_FILE, STANDARD, note
from raff2urdf.graphics.names import home_of
from raff2urdf.readers.options import ReadOptions
from raff2urdf.readers.xml_file import parse_xml, read_text

ENDING = ".xacro"

_BUILT_IN = ("arg", "attribute", "call", "element", "if", "include", "insert_block", "macro", "property", "unless")
_ONE_AT_A_TIME = threading.Lock()  # xacro's state is global
_MOST_FILES, _DEEP, _SHOWN = 1000, 3, 3  # files, and folders down, in which calls of macros are looked for; shown ones


def is_xacro(path: Path, root: Any) -> bool:
    """Return whether a file is xacro, by its ending or its elements."""
    return path.suffix.lower() == ENDING or any(_is_macro(element) for element in root.iter("*"))


class Expanded(NamedTuple):
    """The output of xacro, and the files that it included."""

    text: str
    included: list[Path]


def expanded(path: Path, options: ReadOptions) -> Expanded:
    """Return what xacro makes of a file.

    Raises:
        RaffError: xacro is not installed, or refuses the file; an argument has no value; a package is not found.
    """
    if path == STANDARD:
        raise RaffError(
            f"{path}: xacro can't be read from standard input: pipe the output of `xacro`, or name the file"
        )
    with needs("xacro", f"{path}: files in xacro"):
        import xacro
        from xacro import substitution_args
    arguments, problem = _Arguments(options.xacro_args), list[RaffError]()

    def find(package: str) -> str:
        options.met("package", package)
        try:
            return str(options.search.find(package, path.parent))
        except RaffError as error:
            problem.append(error)
            raise

    with _ONE_AT_A_TIME:
        substitution_args._eval_find = substitution_args._eval_dict["find"] = find
        xacro.all_includes.clear()
        try:
            with contextlib.redirect_stderr(io.StringIO()), warnings.catch_warnings():  # its own traces
                warnings.simplefilter("ignore")  # of expressions in the file
                text = str(xacro.process_file(str(path), mappings=arguments).toprettyxml(indent="  "))
            if len(text) > LARGEST_FILE:
                raise MemoryError(f"its result is larger than {LARGEST_FILE / 1e6:.0f} MB")
        except Exception as error:  # of xacro, of expressions in the file, of XML
            if problem:
                raise RaffError(f"{path}: xacro: {problem[0]}") from None
            if arguments.missing is not None:
                raise RaffError(f"{path}: {_missing(arguments.missing, _declared(path, xacro.all_includes))}") from None
            why = " ".join(str(error).split())[:500] or type(error).__name__
            bare = [name for name, default in _declared(path, xacro.all_includes).items() if default is None]
            if bare and "missing attribute 'default'" in why:
                why = f'{why}: write <xacro:arg name="{bare[0]}" default=""/>, with the default that is meant'
            raise RaffError(f"{path}: xacro: {why}") from None
        finally:
            included = [Path(name) for name in xacro.all_includes]
            for file in included:
                note(file)
    options.met("xacro-arg", *arguments.met, *_declared(path, included))
    return Expanded(text, included)


class _Arguments(dict[str, str]):
    """Arguments of a file.

    Attributes:
        met: names that the file declares or uses.
        missing: an argument that it uses and that has no value; None without.
    """

    def __init__(self, values: Mapping[str, str]) -> None:
        super().__init__(values)
        self.met: dict[str, None] = {}
        self.missing: str | None = None

    def __contains__(self, name: object) -> bool:
        self.met[str(name)] = None
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.met[name] = None
        return super().__getitem__(name)

    def __missing__(self, name: str) -> str:
        self.missing = name
        raise KeyError(name)


def _missing(name: str, declared: Mapping[str, str | None]) -> str:
    """Return the error for an argument without a value."""
    known = [key if default is None else f'{key} (default "{default}")' for key, default in declared.items()]
    option = shell_word(f"{name}=VALUE")
    return (
        f"the argument '{name}' has no value: add --xacro-arg {option} (in Python xacro_args={{{name!r}: VALUE}}); "
        f"the file declares {', '.join(known) or 'no argument'}"
    )


def _declared(path: Path, included: list[Any]) -> dict[str, str | None]:
    """Return the arguments that a file and those that it includes declare, with their defaults."""
    arguments: dict[str, str | None] = {}
    for file in dict.fromkeys([path, *map(Path, included)]):
        with contextlib.suppress(RaffError):
            for element in parse_xml(read_text(file), str(file)).iter("*"):
                if _is_macro(element) and _word(element) == "arg" and element.get("name"):
                    arguments.setdefault(element.get("name"), element.get("default"))
    return arguments


# --- files that only define macros --------------------------------------------------------------------------------


def check_calls(path: Path, output: Expanded) -> None:
    """Refuse a file that defines macros, or includes files that do, and calls none.

    Args:
        path: of the file.
        output: what xacro makes of it.

    Raises:
        RaffError: it names the files nearby that call them.
    """
    if parse_xml(output.text, str(path)).find("link") is not None:
        return
    macros = []
    for file in (path, *output.included):
        with contextlib.suppress(RaffError):
            elements = parse_xml(read_text(file), str(file)).iter("*")
            macros += [element for element in elements if _is_macro(element) and _word(element) == "macro"]
    if not macros:
        return
    names = ", ".join(f"'{macro.get('name')}'" for macro in macros[:_SHOWN]) + ", ..." * (len(macros) > _SHOWN)
    callers = list(map(str, _callers(path)))
    if callers:
        more = f" (and {len(callers) - _SHOWN} more)" if len(callers) > _SHOWN else ""
        remedy = f"load {' or '.join(callers[:_SHOWN])}{more}, which calls them"
    else:
        call = _call(macros[0])
        remedy = f'load a file that calls them, by <xacro:include filename="{path.name}"/> {call}'
    raise RaffError(f"{path}: defines macros only ({names}): {remedy}")


def _call(macro: Any) -> str:
    """Return a call of a macro, with the parameters that have no default."""
    tag = f"xacro:{macro.get('name')}"
    needed = [word for word in macro.get("params", "").split() if "=" not in word]
    blocks = "".join(f"<{word.lstrip('*')}/>" for word in needed if word[0] == "*")
    start = " ".join([f"<{tag}", *(f'{word}="..."' for word in needed if word[0] != "*")])
    return f"{start}>{blocks}</{tag}>" if blocks else f"{start}/>"


def _callers(path: Path) -> Iterator[Path]:
    """Yield the files near a file that include it, themselves or through others, and that call macros."""
    files = {}
    for number, file in enumerate(_near(path)):
        if number >= _MOST_FILES:
            break
        with contextlib.suppress(RaffError):
            text = read_text(file)
            if "include" in text:
                files[file] = parse_xml(text, str(file))
    wanted, done = [path.name], {path.name}
    while wanted:
        name = wanted.pop(0)
        for file, root in files.items():
            included = [e.get("filename", "") for e in root.iter("*") if _is_macro(e) and _word(e) == "include"]
            if file.name in done or not any(uri.rpartition("/")[2] == name for uri in included):
                continue
            done.add(file.name)
            wanted.append(file.name)
            calls = (e for e in root.iter("*") if _is_macro(e) and _word(e) not in _BUILT_IN)
            if any(not any(_word(above) == "macro" for above in call.iterancestors()) for call in calls):
                yield file


def _near(path: Path) -> Iterator[Path]:
    """Yield the files in xacro in a file's folder, then those of its package, the uppermost first."""
    home, start = home_of(path.parent), path.parent
    level = [start, home]
    seen = set[Path]()
    for _ in range(_DEEP + 1):
        below: list[Path] = []
        for folder in level:
            if folder in seen or not folder.is_dir():
                continue
            seen.add(folder)
            entries = sorted(folder.iterdir())
            yield from (entry for entry in entries if entry.suffix in (ENDING, ".urdf") and entry.is_file())
            below += [entry for entry in entries if entry.name[0] != "." and entry.is_dir() and not entry.is_symlink()]
        level = below


def _word(element: Any) -> str:
    """Return an element's name without its namespace or prefix."""
    return str(element.tag).rpartition("}")[2].rpartition(":")[2]


def _is_macro(element: Any) -> bool:
    if any("$(optenv " in value for value in element.attrib.values()):
        return True
    uri = etree.QName(element).namespace if "{" in str(element.tag) else ""
    return str(element.tag).startswith("xacro:") or element.prefix == "xacro" or "/xacro" in (uri or "")
