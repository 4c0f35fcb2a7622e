"""What the site makes from the program itself."""

from typing import Any

from pipeline.cli.settings_reference import settings_reference


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the tables of settings where a page asks for them."""
    return markdown.replace("<!-- settings -->", settings_reference())
