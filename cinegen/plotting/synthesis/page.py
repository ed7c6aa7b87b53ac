"""Pages for reading and printing: one HTML file with pictures inside, without scripts and without anything to load."""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import AbstractContextManager
from io import BytesIO
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from cinegen.plotting.sheet import GREEN, INK, VERMILION
from raff2urdf.escape import html_text

_COLOURS = f":root {{ --ink: {INK}; --good: {GREEN}; --bad: {VERMILION}; }}\n"
_POLICY = "default-src 'none'; style-src 'unsafe-inline'"


def drawing() -> AbstractContextManager[None]:
    """Return a context to draw in: equal pictures become equal files."""
    return mpl.rc_context({"svg.hashsalt": "cinegen", "svg.fonttype": "path"})


def page_of(
    title: str, summary: str, pictures: Iterable[tuple[Figure, str]], remark: str, task: str = "", *, good: bool
) -> str:
    """Return an HTML file. All texts are escaped.

    Args:
        title: its heading.
        summary: preformatted text, marked as good or bad.
        pictures: with their captions.
        remark: a paragraph below them.
        task: preformatted text at the end, if there is any.
        good: whether the summary is.
    """
    title, style = html_text(title), Path(__file__).with_name("page.css").read_text(encoding="utf-8")
    parts = [f"<h1>{title}</h1>", f'<pre class="status{"" if good else " fails"}">{html_text(summary)}</pre>']
    for number, (figure, text) in enumerate(pictures, 1):
        caption = html_text(text)
        parts.append(f"<figure>{_svg(figure, f'p{number}-', caption)}<figcaption>{caption}</figcaption></figure>")
    parts.append(f"<p>{html_text(remark)}</p>")
    parts += [f"<h2>The task</h2>\n<pre>{html_text(task)}</pre>"] * bool(task)
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{html_text(_POLICY)}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{_COLOURS}{style}</style></head>\n<body>\n"
    ) + "\n".join([*parts, "</body></html>\n"])


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
