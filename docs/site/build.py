"""Build the site: the pages of docs/, every example and robot, the reference of commands and of Python, robots of the
gallery that can be dragged, and the six parameters with sliders.

    python docs/site/build.py [FOLDER]

The site is written to FOLDER/html (by default build/site/html). A link that leads nowhere and every warning of Sphinx
are errors. Nothing is loaded from elsewhere: the site can be read from a disk.
"""

from __future__ import annotations

import ast
import posixpath
import re
import runpy
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import typer.main

import cinegen.cli

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
ICON = ROOT / "cinegen/cockpit/static/style/icon.svg"
LINK = re.compile(r"(?<!`)\]\(([^)#\s]+)(#[^)\s]*)?\)")
FENCE = re.compile(r"^```.*?^```$", flags=re.DOTALL | re.MULTILINE)
PAGES = {"CONTRIBUTING.md": "contributing", "SECURITY.md": "security", "CHANGELOG.md": "changes", "README.md": "index"}
GENERATED = {"cinegen/__init__.py": "reference/api", "cinegen/cli/__init__.py": "reference/commands"}
PICTURE = re.compile(r"^!\[(\w+)\]\(pictures/\1\.webp\)$", flags=re.MULTILINE)
LANGUAGES = {".py": "python", ".json": "json", ".toml": "toml"}
PACKAGES = (
    "cinegen.model", "cinegen.ik", "cinegen.assembly", "cinegen.singularities", "cinegen.hexapod", "cinegen.workspace",
    "cinegen.proof", "cinegen.planning", "cinegen.collision", "cinegen.dynamics", "cinegen.design", "cinegen.mission",
    "cinegen.session", "cinegen.cockpit", "cinegen.devices", "cinegen.realtime", "cinegen.plotting", "cinegen.toolpath",
    "raff2urdf",
)  # fmt: skip


class Site:
    """The source of the site: a folder that is filled with Markdown.

    Args:
        folder: folder, emptied first.
    """

    def __init__(self, folder: Path) -> None:
        shutil.rmtree(folder, ignore_errors=True)
        self._folder, self._shown = folder, set[str]()
        shutil.copytree(ROOT / "docs/pictures", folder / "pictures")
        shutil.copytree(HERE / "templates", folder / "templates")
        (folder / "static").mkdir()
        for name in ("conf.py", "names.py", "raff_lexer.py"):
            shutil.copy(HERE / name, folder)
        for file in (HERE / "site.css", HERE / "site.js", ICON):
            shutil.copy(file, folder / "static")

    def write(self, page: str, text: str) -> None:
        """Write a page."""
        path = self._folder / f"{page}.md"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")

    def copy(self, file: str, page: str) -> None:
        """Write a page of the repository, its links changed to those of the site; its blocks remain as they are."""
        text = (ROOT / file).read_text(encoding="utf-8")
        ends = [0, *(end for fence in FENCE.finditer(text) for end in fence.span()), len(text)]
        parts = [text[begin:end] for begin, end in pairwise(ends)]
        parts[::2] = [LINK.sub(lambda link: self._link(link, file, page), part) for part in parts[::2]]
        parts[::2] = [re.sub(r"\$`([^`]+)`\$", r"$\1$", part) for part in parts[::2]]
        parts[1::2] = [re.sub(r"^```(\w+) .*", r"```\1", part) for part in parts[1::2]]  # the name of a file
        self.write(page, "".join(parts))

    def _link(self, link: re.Match[str], file: str, page: str) -> str:
        target, anchor = link[1], link[2] or ""
        if "://" in target or target.startswith("mailto:"):
            return link[0]
        path = posixpath.normpath(posixpath.join(posixpath.dirname(file), target))
        if not (ROOT / path).exists():
            raise SystemExit(f"{file}: no file {target}")
        is_picture = path.startswith("docs/pictures/")
        destination = path.removeprefix("docs/") if is_picture else self._page_of(path) + ".md"
        return f"]({posixpath.relpath(destination, posixpath.dirname(page) or '.')}{anchor})"

    def _page_of(self, path: str) -> str:
        """Return the page that shows a file or a folder of the repository; it is written if it is the first one."""
        source = ROOT / path
        if path in PAGES or path in GENERATED:
            return {**PAGES, **GENERATED}[path]
        if path.startswith("docs/") and path.endswith(".md"):
            return path.removeprefix("docs/").removesuffix(".md")
        if path in ("robots", "examples"):
            return {"robots": "gallery", "examples": "examples"}[path]
        page = f"source/{path}"
        if path not in self._shown:
            self._shown.add(path)
            if source.is_dir():
                files = [file.relative_to(ROOT).as_posix() for file in sorted(source.glob("*.py"))]
                above = posixpath.dirname(page)
                body = "\n".join(
                    f"- [{Path(file).name}]({posixpath.relpath(self._page_of(file), above)}.md)" for file in files
                )
            else:
                language = LANGUAGES.get(source.suffix, "none")
                fence = "`" * 5
                body = f"{fence}{language}\n{source.read_text(encoding='utf-8').rstrip()}\n{fence}"
            self.write(page, f"---\norphan: true\n---\n\n# {path}\n\n{body}\n")
        return page

    def gallery(self) -> None:
        """Write the gallery, each picture with a link to a page in which the robot can be dragged."""
        text = (self._folder / "gallery.md").read_text(encoding="utf-8")
        link = '<p><a href="live/{name}.html">Drag {name} in the browser</a></p>'
        self.write("gallery", PICTURE.sub(lambda match: f"{match[0]}\n\n{link.format(name=match[1])}", text))

    def protocol(self) -> None:
        """Write the tables of messages and files, from their schemas."""
        text = (self._folder / "reference/protocol.md").read_text(encoding="utf-8")
        self.write("reference/protocol", runpy.run_path(str(ROOT / "docs/protocols.py"))["written"](text))

    def joints(self) -> None:
        """Replace the picture of the six parameters by a page with sliders."""
        text = (self._folder / "joints.md").read_text(encoding="utf-8")
        frame = (
            '<iframe class="parameters" src="live/six_parameters.html" title="Six sliders and four frames"></iframe>'
        )
        shown, count = re.subn(r"^!\[[^]]*\]\(pictures/joints_any\.svg\)$", frame, text, flags=re.MULTILINE)
        if count != 1:
            raise SystemExit("docs/joints.md: the picture of the six parameters is missing")
        self.write("joints", shown)

    def parameters(self) -> None:
        """Write the page with sliders; without a script it shows the picture."""
        folder, output = HERE / "parameters", self._folder / "extra/live/six_parameters.html"
        code = "\n".join((folder / f"{name}.js").read_text(encoding="utf-8") for name in ("frames", "picture", "page"))
        code = re.sub(r"^import .*;\n|^export ", "", code, flags=re.MULTILINE)
        page = (folder / "page.html").read_text(encoding="utf-8")
        picture = (ROOT / "docs/pictures/joints_any.svg").read_text(encoding="utf-8")
        output.parent.mkdir(parents=True, exist_ok=True)
        page = page.replace("{{picture}}", picture).replace("{{script}}", f"(() => {{\n{code}}})();")
        output.write_text(page, encoding="utf-8")

    def robots(self) -> None:
        """Write the pages in which the robots of the gallery can be dragged."""
        (self._folder / "extra/live").mkdir(parents=True, exist_ok=True)
        for name in PICTURE.findall((self._folder / "gallery.md").read_text(encoding="utf-8")):
            page = self._folder / f"extra/live/{name}.html"
            if cinegen.cli.main(["page", str(ROOT / f"robots/{name}.raff"), "-o", str(page)]):
                raise SystemExit(f"no page of {name}")

    def examples(self) -> None:
        """Write a page of cards in groups: of each example the picture, and the text at its top."""
        paths = {path.stem: path for path in sorted((ROOT / "examples").glob("*.py"))}
        groups = tomllib.loads((HERE / "examples.toml").read_text(encoding="utf-8"))
        shown = [name for cards in groups.values() for name in cards]
        if sorted(shown) != list(paths):
            raise SystemExit(f"docs/site/examples.toml: one card for {', '.join(sorted({*shown} ^ {*paths}))}?")
        lines = ["# Examples", "", "Each is a program; `cinegen` and its extras are all that it needs.", ""]
        for group, cards in groups.items():
            lines += [f"## {group}", "", ":::{container} cards"]
            for name, card in cards.items():
                text = (ast.get_docstring(ast.parse(paths[name].read_text(encoding="utf-8"))) or "").partition("\n\n")[
                    0
                ]
                page = self._page_of(paths[name].relative_to(ROOT).as_posix())
                title = card.get("title") or name[3:].replace("_", " ").capitalize()
                lines.append(
                    f"- ![{card['alt']}](pictures/{card['picture']}) [{title}]({page}.md) {' '.join(text.split())}"
                )
            lines += [":::", ""]
        papers = self._page_of("examples/papers")
        lines += [f"[Reproductions of papers]({papers}.md) check figures and numbers of the sources.", ""]
        self.write("examples", "\n".join(lines))

    def commands(self) -> None:
        """Write the options of all commands, from their definitions."""
        lines = ["# Options of all commands", "", "As `cinegen COMMAND --help` shows them.", ""]
        for name, command in sorted(typer.main.get_command(cinegen.cli.app).commands.items()):  # type: ignore[attr-defined]
            if command.hidden:
                continue
            lines += [f"## cinegen {name}", "", (command.help or "").strip(), "", "| option | does |", "| --- | --- |"]
            for parameter in command.params:
                if getattr(parameter, "hidden", False):
                    continue
                named = parameter.opts if parameter.param_type_name == "option" else [str(parameter.name).upper()]
                names = ", ".join(f"`{option}`" for option in named)
                help_text = " ".join((getattr(parameter, "help", "") or "").split()).replace("|", "\\|")
                lines.append(f"| {names} | {help_text} |")
            lines.append("")
        self.write("reference/commands", "\n".join(lines))

    def python(self) -> None:
        """Write the reference of the public names, from their docstrings; those that guides use most come first."""
        lines = [
            "# Python",
            "",
            "Public names of the packages. Those in bold can be imported from `cinegen` itself.",
            "",
        ]
        pages = list[str]()
        texts = [*(ROOT / "docs").glob("**/*.md"), *(ROOT / "examples").glob("*.py")]
        uses = Counter(word for path in texts for word in re.findall(r"\w+", path.read_text(encoding="utf-8")))
        for package in PACKAGES:
            module = import_module(package)
            summary = (module.__doc__ or "").strip().partition("\n\n")[0]
            names = sorted(module.__all__, key=lambda name: (-uses[name], name.lower()))
            above = cinegen.__all__ if package.startswith("cinegen.") else ()
            shown = ", ".join(f"**{name}**" if name in above else name for name in names)
            page = f"api/{package.removeprefix('cinegen.')}"
            pages.append(page)
            lines += [f"- [{package}]({page}.md): {' '.join(summary.split())} {shown}"]
            things = {name: thing for name in names if callable(thing := getattr(module, name))}
            entries = [f".. auto{_kind_of(thing)}:: {package}.{name}\n" for name, thing in things.items()]
            body = "\n".join([f".. automodule:: {package}\n   :no-members:\n", *entries])
            self.write(f"reference/{page}", f"# {package}\n\n```{{eval-rst}}\n{body}```\n")
        tree = "\n".join(pages)
        self.write("reference/api", "\n".join(lines) + f"\n\n```{{toctree}}\n:hidden:\n\n{tree}\n```\n")


def _kind_of(thing: object) -> str:
    """Return the directive of autodoc, without "auto", for a class or a function."""
    if isinstance(thing, type):
        return "exception" if issubclass(thing, BaseException) else "class"
    return "function"


def fill(site: Site) -> None:
    """Write all pages."""
    docs = ROOT / "docs"
    for path in sorted(docs.glob("*.md")) + sorted(docs.glob("howto/*.md")) + sorted(docs.glob("reference/*.md")):
        site.copy(path.relative_to(ROOT).as_posix(), path.relative_to(docs).with_suffix("").as_posix())
    for file, page in PAGES.items():
        if page != "index":
            site.copy(file, page)
    site.write("index", (HERE / "index.md").read_text(encoding="utf-8"))
    site.gallery()
    site.protocol()
    site.joints()
    site.examples()
    site.commands()
    site.python()


def main() -> int:
    """Build the site; return Sphinx' status."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "build/site")
    site = Site(folder / "source")
    fill(site)
    site.robots()
    site.parameters()
    shutil.rmtree(folder / "html", ignore_errors=True)
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", folder / "source", folder / "html"]
    status = subprocess.run(command, check=False).returncode
    if not status:
        print(f"{folder}/html/index.html")
    return status


if __name__ == "__main__":
    sys.exit(main())
