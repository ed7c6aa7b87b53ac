"""Tables that notebooks show."""

from __future__ import annotations

from collections.abc import Iterable

from raff2urdf.escape import html_text


def table(caption: str, headings: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return an HTML table; all texts are escaped."""
    lines = [_row("th", headings), *(_row("td", row) for row in rows)]
    return f"<table><caption>{html_text(caption)}</caption>{''.join(lines)}</table>"


def _row(tag: str, texts: Iterable[object]) -> str:
    return f"<tr>{''.join(f'<{tag}>{html_text(text)}</{tag}>' for text in texts)}</tr>"
