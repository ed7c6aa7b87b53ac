"""Lint the prose of the project: `python tests/docs/prose.py` prints what is found, and fails if anything is.

- Words of `vocabulary.toml` that have a standard term, in pages, docstrings, help texts and messages, and in what the
  cockpit and pages without a server show; there, names of code too, which renaming leaves in sentences.
- Sentences of pages with more than 35 words.
- Pages in which more than 40 % of the sentences are passive.
- Docstrings of the packages that open with a clause, and public classes that share a name.
"""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("cinegen", "raff2urdf", "ros2", "examples")
SCREENS = ("cinegen/cockpit/static", "cinegen/page/static", "docs/site")
LONGEST = 35  # words of a sentence
PASSIVE = 0.4  # part of a page's sentences
FEWEST = 20  # sentences of a page whose part is judged

_CODE = re.compile(r"```.*?```|`[^`]*`|(?<=\])\([^)]*\)", re.DOTALL)
_BLOCK = re.compile(r"^```.*?^```$|<!--.*?-->", re.MULTILINE | re.DOTALL)
_ITEM = re.compile(r"(?:[-*]|\d+\.) ")
_ABBREVIATED = re.compile(r"\b(e\.g|i\.e|vs|fig|vol|pp|cf)\.|(?<![\^\w] )(?<!\^)\b([A-Z])\.(?= [A-Z][a-z]|-[A-Z])")
_END = re.compile(r"(?<=[.!?])[\"”)]?\s+(?=[\"(]?[A-Z0-9])")
_CITED = re.compile(r" \([^()]*\b(?:19|20)\d\d\b[^()]*\)")
_COMMENT = re.compile(r"(?<![:\w\"'])//[^\n]*|/\*.*?\*/|<!--.*?-->", re.DOTALL)
_SHOWN = {  # texts that people see or hear
    ".js": re.compile(r'"((?:[^"\\\n]|\\.)*)"|`([^`]*)`'),
    ".html": re.compile(r'>([^<>{}]+)<|\b(?:title|aria-label|placeholder|content)="([^"]*)"'),
}
_CAMEL = re.compile(r"\b(?:(?!Code)[A-Z][a-z]+){2,}\b")  # "Code": see `shown`
_BRANDS = {"JavaScript", "SpaceMouse"}
_PASSIVE = re.compile(
    r"\b(?:is|are|was|were|be|been|being)\s+(?:\w+ly\s+)?(?:not\s+)?\w+(?:ed|en|own|ade|elt|ept|ound|iven|one)\b"
)


_OPENINGS = re.compile(r"\s*(What|Whether|How|Of|Where|Who|Whose|Whom|That|Those)\b")


@dataclass(frozen=True)
class Term:
    """Words that have a standard term, and where they may stand nevertheless."""

    find: re.Pattern[str]
    use: str
    allow: re.Pattern[str] | None
    skip: tuple[str, ...]
    bad: str
    good: str

    @classmethod
    def read(cls, entry: dict[str, object]) -> Term:
        """Make a term of its table in the file."""
        allow = "|".join(entry.get("allow", []))  # type: ignore[arg-type]
        return cls(
            re.compile(rf"\b(?:{entry['find']})\b".replace(" ", r"\s+"), re.IGNORECASE),
            str(entry["use"]),
            re.compile(allow.replace(" ", r"\s+"), re.IGNORECASE) if allow else None,
            tuple(entry.get("skip", ())),  # type: ignore[arg-type]
            str(entry["bad"]),
            str(entry["good"]),
        )

    def hits(self, text: str) -> Iterator[re.Match[str]]:
        """Yield where the words stand in a text, apart from what is allowed."""
        free = [match.span() for match in self.allow.finditer(text)] if self.allow else []
        for match in self.find.finditer(text):
            if not any(begin < match.end() and match.start() < end for begin, end in free):
                yield match


TERMS = [Term.read(entry) for entry in tomllib.loads((Path(__file__).parent / "vocabulary.toml").read_text())["term"]]


def words_of(text: str, where: str, line: int = 1, file: str = "") -> list[str]:
    """Return a line for each word of a text that has a standard term; code in it does not count."""
    bare = _CODE.sub(lambda code: re.sub(r"[^\n]", " ", code.group()), text)
    findings = []
    for term in TERMS:
        if file in term.skip:
            continue
        for match in term.hits(bare):
            number = line + bare.count("\n", 0, match.start())
            findings.append(f"{where}:{number}: '{' '.join(match.group().split())}': {term.use}")
    return findings


def pages() -> list[Path]:
    """Return the pages that are linted."""
    names = ("README.md", "CONTRIBUTING.md", "SECURITY.md")
    return [*(ROOT / name for name in names), *sorted((ROOT / "docs").rglob("*.md"))]


def strings(package: str) -> Iterator[tuple[str, int, str]]:
    """Yield file, line and text of the docstrings, help texts and messages of a folder."""
    for path in sorted((ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
                yield str(path.relative_to(ROOT)), node.lineno, node.value


def code_findings_of(*packages: str) -> list[str]:
    """Return a line for each docstring that opens with a clause, and for each public class whose name is taken."""
    findings, places = [], dict[str, str]()
    for path in (path for package in packages for path in sorted((ROOT / package).rglob("*.py"))):
        name, tree = str(path.relative_to(ROOT)), ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                text = ast.get_docstring(node) or ""
                if _OPENINGS.match(text):
                    findings.append(f"{name}:{getattr(node, 'lineno', 1)}: opens with a clause: {text.splitlines()[0]}")
        for statement in tree.body:
            public = isinstance(statement, ast.ClassDef) and not statement.name.startswith("_")
            if public and (other := places.setdefault(statement.name, name)) != name:
                findings.append(f"{name}:{statement.lineno}: class {statement.name} is also in {other}")
    return findings


def shown(folder: str) -> Iterator[tuple[str, int, str]]:
    """Yield file, line and text of what the pages of a folder show."""
    for path in sorted(file for kind in _SHOWN for file in (ROOT / folder).rglob(f"*{kind}")):
        text = path.read_text(encoding="utf-8")
        bare = _COMMENT.sub(lambda comment: re.sub(r"[^\n]", " ", comment.group()), text)
        for match in _SHOWN[path.suffix].finditer(bare):
            words = re.sub(r"\$\{[^{}]*\}", "Code", match[1] or match[2] or "")
            if " " not in words.strip():
                continue
            yield str(path.relative_to(ROOT)), bare.count("\n", 0, match.start()) + 1, words


def code_names_of(text: str, where: str, line: int = 1) -> list[str]:
    """Return a line for each name of a class in a text."""
    names = [name for name in _CAMEL.findall(text) if name not in _BRANDS]
    return [f"{where}:{line}: '{name}': words, not a name of code" for name in names]


def paragraphs(text: str) -> Iterator[tuple[int, str]]:
    """Yield first line and text of each paragraph or item of a page, without tables, blocks and headings."""
    first, lines = 0, list[str]()
    for number, line in enumerate(_BLOCK.sub(lambda block: "\n" * block.group().count("\n"), text).splitlines(), 1):
        bare = line.strip()
        ends = not bare or bare.startswith(("|", "#", "!", "<")) or " · " in bare or line.startswith("    ")
        if (ends or _ITEM.match(bare)) and lines:
            yield first, " ".join(lines)
            lines = []
        if not ends:
            first = first if lines else number
            lines.append(_ITEM.sub("", bare, count=1) if _ITEM.match(bare) else bare)
    if lines:
        yield first, " ".join(lines)


def sentences(paragraph: str) -> list[str]:
    """Return the sentences of a paragraph: links without targets, formulas and code as one word, without citations."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", paragraph)
    text = re.sub(r"\$`[^`]*`\$|`[^`]*`", "Code", text).replace("*", "")
    text = re.sub(r"\\ (?=Source)", "\n", _CITED.sub("", text))
    text = _ABBREVIATED.sub(lambda match: match.group().replace(".", ""), text)
    return [sentence for sentence in _END.split(text) if sentence]


def style_of(path: Path) -> tuple[list[tuple[int, int, str]], float]:
    """Return line, words and text of a page's long sentences, and the part of its sentences that is passive."""
    parts = paragraphs(path.read_text(encoding="utf-8"))
    all_sentences = [(line, sentence) for line, part in parts for sentence in sentences(part)]
    counted = [(line, len(re.findall(r"[\w'’-]+", sentence)), sentence) for line, sentence in all_sentences]
    passive = sum(bool(_PASSIVE.search(sentence)) for _, sentence in all_sentences)
    few = len(all_sentences) < FEWEST
    return [row for row in counted if row[1] > LONGEST], 0.0 if few else passive / len(all_sentences)


def findings_of(path: Path) -> list[str]:
    """Return a line for each finding in a page."""
    name = path.relative_to(ROOT).as_posix()
    findings = words_of(path.read_text(encoding="utf-8"), name, file=name)
    long, passive = style_of(path)
    findings += [f"{name}:{line}: a sentence of {count} words: {text[:60]} ..." for line, count, text in long]
    if passive > PASSIVE:
        findings.append(f"{name}: {passive:.0%} of the sentences are passive: let who acts be the subject")
    return findings


def main() -> int:
    """Print all findings."""
    findings = [finding for path in pages() for finding in findings_of(path)] + code_findings_of("cinegen", "raff2urdf")
    for package in PACKAGES:
        for file, line, text in strings(package):
            findings += words_of(text, file, line, file)
    for folder in SCREENS:
        for file, line, text in shown(folder):
            findings += words_of(text, file, line, file) + code_names_of(text, file, line)
    print(*findings, sep="\n", end="\n" if findings else "")
    where = f"{len(pages())} pages and the texts of {len(PACKAGES) + len(SCREENS)} folders"
    print(f"prose: {len(findings)} findings in {where}", file=sys.stderr)
    return bool(findings)


if __name__ == "__main__":
    sys.exit(main())
