"""Pages for reading and printing: one HTML file with pictures inside, without scripts and without anything to load."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from typing import TYPE_CHECKING

from cinegen.arrays import Array
from cinegen.design.parameters import Parameters
from cinegen.html import table
from cinegen.plotting.sheet import FAINT, GREEN, INK, VERMILION
from raff2urdf.escape import html_text
from raff2urdf.extras import needs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STYLE = f"""
:root {{ color-scheme: light; }}
body {{ margin: 2rem auto; padding: 0 1.5rem; max-width: 54rem; color: {INK}; background: white;
  font: 16px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; overflow-wrap: anywhere; }}
h1 {{ font-size: 1.6rem; line-height: 1.25; margin: 0 0 .5rem; }}
h2 {{ font-size: 1.15rem; margin: 2.2rem 0 .5rem; padding-top: .6rem; border-top: 1px solid #d3d7dc; }}
p {{ margin: .5rem 0; max-width: 48rem; }}
.status {{ padding: .5rem .8rem; border-left: .3rem solid {GREEN}; background: #f4f6f8; max-width: none; }}
.status.fails {{ border-color: {VERMILION}; }}
dl {{ display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1.2rem; margin: .5rem 0; }}
dt {{ color: #5a626b; }}
dd {{ margin: 0; }}
.scroll {{ overflow-x: auto; }}
table {{ border-collapse: collapse; margin: .6rem 0; font-size: .9em; font-variant-numeric: tabular-nums;
  overflow-wrap: normal; }}
caption {{ text-align: left; color: #5a626b; padding-bottom: .3rem; }}
th, td {{ text-align: left; padding: .2rem 1.4rem .2rem 0; border-bottom: 1px solid #e3e6ea; vertical-align: top; }}
th {{ border-color: {FAINT}; font-weight: 600; }}
figure {{ margin: .8rem 0; }}
figure svg {{ display: block; width: 100%; height: auto; }}
figcaption {{ font-size: .9em; color: #5a626b; max-width: 48rem; margin-top: .3rem; }}
pre {{ font-size: .8em; line-height: 1.35; background: #f4f6f8; padding: .6rem .8rem; white-space: pre-wrap; }}
@page {{ size: A4; margin: 15mm; }}
@media print {{
  body {{ margin: 0; padding: 0; max-width: none; font-size: 9.5pt; line-height: 1.4; }}
  h1 {{ font-size: 15pt; }} h2 {{ font-size: 11.5pt; margin-top: 14pt; break-after: avoid; }}
  figure, tr, dl, .status {{ break-inside: avoid; }}
  .scroll {{ overflow: visible; }}
  th, td {{ padding-right: 9pt; }}
  .status, pre {{ print-color-adjust: exact; -webkit-print-color-adjust: exact; }}
}}
"""

_POLICY = "default-src 'none'; style-src 'unsafe-inline'"


@contextmanager
def drawing() -> Iterator[None]:
    """Draw within this context: equal pictures become equal files."""
    with needs("plot", "pictures"):
        import matplotlib as mpl

    settings = {"svg.hashsalt": "cinegen", "svg.fonttype": "path"}
    with mpl.rc_context(settings):  # type: ignore[arg-type]
        yield


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
        self._parts.append(f"<p>{html_text(' '.join(one for one in sentences if one))}</p>")

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
        title = html_text(self.title)
        return (
            f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            f'<meta http-equiv="Content-Security-Policy" content="{html_text(_POLICY)}">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"<title>{title}</title><style>{_STYLE}</style></head>\n<body>\n<h1>{title}</h1>\n"
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
