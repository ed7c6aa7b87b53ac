"""What README and docs say is what happens: each page is read from top to bottom, in a folder with a copy of robots/;
those of docs/howto in an empty one, as of somebody who has installed cinegen.

Python blocks run in one namespace for each page. A `text` block that comes next is what one prints. RAFF blocks are
read, and whole files converted too; the word behind `raff` may be the name they are saved by ("excerpt": only read,
"wrong": must fail); NFF blocks are read and saved, XML, YAML, TOML, CSV, C and JavaScript blocks saved. In `console`
blocks the lines behind `$` are run (gcc, node and what gcc makes where there are gcc and node), and the others are what
is printed. A number below 1e-12 is as good as another, digits beyond the 12th decimal don't count, and a line `...`
stands for any lines.
"""

import contextlib
import importlib
import io
import json
import re
import shlex
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import pytest
from pages import NAMES, ROOT, Block, blocks, table
from variants import slow

import cinegen
import raff2urdf
from raff2urdf.graphics import nff

LONG = {
    f"docs/{name}.md"
    for name in (
        *("avoidance", "cluster", "cockpit", "design", "forces", "maps", "parallel", "proof"),
        *("howto/firmware", "howto/headset", "howto/synthesis"),
    )
}
"""Pages of commands and calls that take long, and that other tests run too."""

COMMANDS = {"raff2urdf": "raff2urdf.cli", "urdf2raff": "raff2urdf.urdf2raff.cli", "cinegen": "cinegen.cli"}


@pytest.fixture
def folder(tmp_path, monkeypatch, name) -> Path:
    """A working folder that pages may write to."""
    if not name.startswith("docs/howto/"):
        shutil.copytree(ROOT / "robots", tmp_path / "robots")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", [slow(name)[0] if name in LONG else name for name in NAMES])
def test_a_page_says_what_happens(name: str, folder: Path):
    page = ROOT / name
    namespace: dict[str, object] = {"__name__": "page"}
    printed: str | None = None
    for block in blocks(page):
        where = f"{name}:{block.line}"
        if block.language == "python":
            printed = _run(block, namespace, where)
        elif block.language == "text":
            if printed is not None:
                assert _same(block.text, printed, folder), f"{where}: this is printed:\n{printed}"
            printed = None
        else:
            printed = None
            if block.language == "raff":
                _read(block, folder, where)
            elif block.language == "console":
                _console(block, folder, where)
            elif block.language == "nff":
                (folder / block.word).write_text(block.text, encoding="utf-8")
                assert nff.read(folder / block.word), f"{where}: holds no surface"
            elif block.language in ("xml", "yaml", "toml", "csv", "c", "js"):
                (folder / block.word).write_text(block.text, encoding="utf-8")
            elif block.language == "json":
                json.loads(block.text)
            else:
                assert block.language in ("sh", "math", "html"), f"{where}: '{block.language}' is not checked"


def _run(block: Block, namespace: dict[str, object], where: str) -> str:
    out = io.StringIO()
    code = compile("\n" * (block.line - 1) + block.text, where, "exec")  # errors show the page's line
    with contextlib.redirect_stdout(out), warnings.catch_warnings():
        warnings.simplefilter("error", raff2urdf.RaffWarning)
        warnings.simplefilter("error", cinegen.CinegenWarning)
        exec(code, namespace)
    return out.getvalue()


def _read(block: Block, folder: Path, where: str) -> None:
    words = block.word.split()
    path = folder / ([word for word in words if word.endswith(".raff")] or ["block.raff"])[0]
    path.write_text(block.text, encoding="utf-8")
    if "wrong" in words:
        with pytest.raises(raff2urdf.RaffError):
            raff2urdf.convert(path, folder / "converted")
        return
    whole = block.text.startswith("RAFF")
    raff2urdf.loads(block.text if whole else _completed(block.text), where)
    if whole and "excerpt" not in words:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", raff2urdf.RaffWarning)  # some are shown on purpose
            assert raff2urdf.convert(path, folder / "converted")


def _completed(part: str) -> str:
    """A part of a file as a whole one, with the fathers that it does not show."""
    if re.match(r"\s*(units|gravity|sensor|robot)\b", part):
        return f"RAFF part\n{part}"
    shown = set(re.findall(r"\b(?:link|frame) (\d+)\s*\{", part)) | {"0"}
    fathers = "".join(f"link {n} {{ type 2 pred 0 }}\n" for n in sorted(set(re.findall(r"pred (\d+)", part)) - shown))
    return f"RAFF part\nrobot part {{\n{fathers}{part}}}\n"


def _console(block: Block, folder: Path, where: str) -> None:
    for command, said in re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", block.text, flags=re.MULTILINE):
        words, stdin = shlex.split(command), ""
        if words[0] == "echo" and words[2] == "|":
            stdin, words = f"{words[1]}\n", words[3:]
        if words[0] == "cat":
            printed = Path(folder, words[1]).read_text(encoding="utf-8")
        elif words[:2] == ["cinegen", "drive"]:
            printed = _in_a_process([sys.executable, "-m", *words])
        elif words[0] in ("gcc", "node") or words[0].startswith("./"):
            if shutil.which(words[0]) is None:
                continue
            printed = _in_a_process(words)
        else:
            assert words[0] in COMMANDS, f"{where}: '{words[0]}' is not run"
            printed, code = _in_this_process(words, stdin)
            assert code == 0 or said != "...\n", f"{where}: {command} fails:\n{printed}"
        assert _same(said, printed, folder), f"{where}: {command} prints:\n{printed}"


def _in_a_process(command: list[str]) -> str:
    return subprocess.run(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300,
        check=False,
    ).stdout  # fmt: skip


def _in_this_process(words: list[str], stdin: str) -> tuple[str, int]:
    """The same, without a second for all imports."""
    said = io.StringIO()
    monkey = pytest.MonkeyPatch()
    monkey.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(stdin.encode())))
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():
        warnings.simplefilter("default")
        warnings.simplefilter("ignore", DeprecationWarning)  # as Python does, in modules of others
        code = importlib.import_module(COMMANDS[words[0]]).main(words[1:])
    monkey.undo()
    return said.getvalue(), code


def _same(said: str, printed: str, folder: Path) -> bool:
    """Whether a text says what was printed, noise and what `...` stands for apart."""
    said, printed = _settled(said), _settled(printed.replace(str(folder.resolve()), "..."))
    pattern = "".join(r"(?:.*\n)*?" if line == "...\n" else re.escape(line) for line in said.splitlines(keepends=True))
    return re.fullmatch(pattern, printed) is not None


def _settled(text: str) -> str:
    text = re.sub(r"-?\b(?:\d(?:\.\d+)?e-(?:1[3-9]|[2-9]\d)|0(?:\.0+)?e\+00)\b", "0", text)
    text = re.sub(r"(\.\d{12})\d+\b", r"\1", text)
    text = re.sub(r"\b\d\.\d+ (?=MB, needs no server)", "", text)  # any change of the page changes it
    text = re.sub(r"127\.0\.0\.1:\d+/\?(token|view)=\S+", r"127.0.0.1:port/?\1=...", text)
    return "".join(f"{line.rstrip()}\n" for line in text.strip("\n").splitlines())


def test_the_table_of_robots_is_right(robot):
    rows = table(ROOT / "docs/gallery.md", "file")
    said = {row[0].strip("`"): row[1:] for row in rows}
    files = {path.name for path in (ROOT / "robots").glob("*.raff")}
    assert {name.split(" ")[0].strip("`") for name in said} == files
    for name, (joints, loops, mobility) in said.items():
        if name == "two_arms.raff":
            continue  # two robots: the test below
        mechanism = robot(name.removesuffix(".raff"))
        assert (joints, loops, mobility) == (
            f"{len(mechanism.joints)} ({len(mechanism.actuated)})",
            str(len(mechanism.loops)),
            str(mechanism.mobility),
        ), name


def test_the_table_of_tolerances_is_right():
    rows = table(ROOT / "docs" / "how-it-works.md", "name")
    assert len(rows) >= 10
    for name, value, *_ in rows:
        module, _, word = name.strip("`").rpartition(".")
        assert getattr(importlib.import_module(module), word) == float(value), name
