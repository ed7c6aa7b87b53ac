"""Pages for reading and printing: one HTML file with pictures inside, without scripts and without anything to load."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from cinegen.arrays import Array
from cinegen.design.parameters import Parameters
from cinegen.html import table
from cinegen.plotting.sheet import FAINT, GREEN, INK, VERMILION
from raff2urdf.escape import html_text

_COLOURS = f":root {{ --ink: {INK}; --faint: {FAINT}; --good: {GREEN}; --bad: {VERMILION}; }}\n"
_POLICY = "default-src 'none'; style-src 'unsafe-inline'"


def drawing() -> AbstractContextManager[None]:
    """Return a context to draw in: equal pictures become equal files."""
    return mpl.rc_context({"svg.hashsalt": "cinegen", "svg.fonttype": "path"})


@dataclass
class ReportPage:
    """A page that grows section by section. All texts are escaped.

    Attributes:
        title: of the page.
    """

    title: str
    _parts: list[str] = field(default_factory=list)
    _pictures: int = 0

    def section(self, title: str) -> None:
        """Begin a section."""
        self._parts.append(f"<h2>{html_text(title)}</h2>")

    def text(self, *sentences: str) -> None:
        """Add a paragraph of sentences, if there are any."""
        if not any(sentences):
            return
        self._parts.append(f"<p>{html_text(' '.join(sentence for sentence in sentences if sentence))}</p>")

    def status(self, text: str, *, good: bool) -> None:
        """Add a sentence that is marked as good or bad."""
        self._parts.append(f'<p class="status{"" if good else " fails"}">{html_text(text)}</p>')

    def terms(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Add terms with their descriptions."""
        lines = (f"<dt>{html_text(term)}</dt><dd>{html_text(text)}</dd>" for term, text in pairs)
        self._parts.append(f"<dl>{''.join(lines)}</dl>")

    def table(self, caption: str, headings: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
        """Add a table."""
        self._parts.append(f'<div class="scroll">{table(caption, headings, rows)}</div>')

    def parameters(
        self, of: Parameters, p: Array, names: Sequence[str], notes: Sequence[str] = (), digits: int = 7
    ) -> None:
        """Add the table of free parameters with their values p after a synthesis."""
        rows = [
            [title, *(of.text(name, x, digits) for x in (before, after)), " to ".join(of.text(name, x) for x in bounds)]
            for title, name, before, after, bounds in zip(names, of.names, of.values, p, of.bounds, strict=True)
        ]
        rows = [[*row, note] for row, note in zip(rows, notes, strict=True)] if notes else rows
        self.table("Free parameters", ["parameter", "before", "after", "range", *[""] * bool(notes)], rows)

    def listing(self, text: str) -> None:
        """Add preformatted text."""
        self._parts.append(f"<pre>{html_text(text)}</pre>")

    def picture(self, figure: Figure, caption: str) -> None:
        """Add a picture, as SVG, with its caption."""
        self._pictures += 1
        caption = html_text(caption)
        drawn = _svg(figure, f"p{self._pictures}-", caption)
        self._parts.append(f"<figure>{drawn}<figcaption>{caption}</figcaption></figure>")

    def text_of_page(self) -> str:
        """Return the HTML file."""
        title, style = html_text(self.title), Path(__file__).with_name("page.css").read_text(encoding="utf-8")
        return (
            f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            f'<meta http-equiv="Content-Security-Policy" content="{html_text(_POLICY)}">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"<title>{title}</title><style>{_COLOURS}{style}</style></head>\n<body>\n<h1>{title}</h1>\n"
            + "\n".join(self._parts)
            + "\n</body></html>\n"
        )


def _svg(figure: Figure, prefix: str, label: str) -> str:
    """Return a figure as an element of HTML, whose identifiers have a prefix."""
    buffer = BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue().decode()
    text = text[text.index("<svg") :]
    text = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'\bid="', f'id="{prefix}', text)
    text = re.sub(r'href="#', f'href="#{prefix}', text)
    text = re.sub(r"url\(#", f"url(#{prefix}", text)
    box = re.search(r'viewBox="[^"]*"', text)
    assert box is not None
    text = f'<svg {box[0]} role="img" aria-label="{label}">{text[text.index(">") + 1 :]}'
    text = text.replace("xlink:href=", "href=")
    return re.sub(r"\n\s*\n+", "\n", text).strip()
