"""The elements of an HTML text, as Python's own parser reads them."""

from html.parser import HTMLParser


class Elements(HTMLParser):
    """All elements of a page: tag, attributes, and the text that follows the tag.

    Attributes:
        found: [tag, attributes, text] of each element.
    """

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[list] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element."""
        self.found.append([tag, dict(attrs), ""])

    def handle_data(self, data: str) -> None:
        """Note a text."""
        if self.found:
            self.found[-1][2] += data

    def named(self, tag: str) -> list[tuple[dict[str, str | None], str]]:
        """Return attributes and text of all elements of a kind."""
        return [(attributes, text) for name, attributes, text in self.found if name == tag]
