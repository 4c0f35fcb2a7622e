"""What the site makes from the program itself."""

from typing import Any


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the table of settings where a page asks for it."""
    return markdown
