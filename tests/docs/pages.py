"""The pages of the documentation, cut into what can be checked: their blocks of code, tables and links."""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_TOP = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md")
_DOCS = ROOT / "docs"
_FOLDERS = (_DOCS, _DOCS / "howto", _DOCS / "reference")
PAGES = [*(ROOT / name for name in _TOP), *(page for folder in _FOLDERS for page in sorted(folder.glob("*.md")))]
NAMES = [page.relative_to(ROOT).as_posix() for page in PAGES]


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, the word behind it, its text, and the page's line where the text begins."""

    language: str
    word: str
    text: str
    line: int


def blocks(page: Path) -> list[Block]:
    """The fenced blocks of a page, in order."""
    page_blocks: list[Block] = []
    opened: tuple[str, int] | None = None
    lines: list[str] = []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        if line.startswith("```"):
            if opened is None:
                opened, lines = (line.removeprefix("```").strip(), number + 1), []
                assert opened[0], f"{page.name}:{number}: a block without a language"
            else:
                language, _, word = opened[0].partition(" ")
                page_blocks.append(Block(language, word, "\n".join(lines) + "\n", opened[1]))
                opened = None
        elif opened is not None:
            lines.append(line)
    assert opened is None, f"{page.name}: the block of line {opened[1]} is not closed"
    return page_blocks


def prose(page: Path) -> str:
    """A page without its fenced blocks."""
    return re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def links(page: Path) -> list[str]:
    """What its links and pictures name."""
    text = re.sub(r"`[^`\n]*`", "", prose(page))
    return re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r'(?:src|href)="([^"]+)"', text)


def anchors(page: Path) -> set[str]:
    """The names of its headings, as GitHub makes them."""
    heads = re.findall(r"^#+ (.+)$", prose(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.strip().lower()).replace(" ", "-") for head in heads}


def table(page: Path, first: str) -> list[list[str]]:
    """The cells of the table whose first heading is `first`, below its headings."""
    text = prose(page)
    match = re.search(rf"^\| {re.escape(first)} \|.*\n\|[-| :]+\|\n((?:\|.*\n)+)", text, flags=re.MULTILINE)
    assert match, f"{page.name} has no table '{first}'"
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in match[1].splitlines()]
