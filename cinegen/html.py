"""Tables that notebooks show."""

from __future__ import annotations

import html
from collections.abc import Iterable


def table(caption: str, headings: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return an HTML table; all texts are escaped."""
    lines = [_row("th", headings), *(_row("td", row) for row in rows)]
    return f"<table><caption>{html.escape(caption)}</caption>{''.join(lines)}</table>"


def _row(tag: str, texts: Iterable[object]) -> str:
    return f"<tr>{''.join(f'<{tag}>{html.escape(str(text))}</{tag}>' for text in texts)}</tr>"
