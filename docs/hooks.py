"""What the site makes from the program itself."""

from typing import Any

from pipeline.cli.main import app, whole_help
from pipeline.cli.settings_reference import settings_reference


def on_startup(**_: Any) -> None:
    """Let the command reference have all that the commands say of themselves."""
    for name in app:
        whole_help(name)
        if name in ("tokens", "glyphs"):
            for sub in app[name]:
                whole_help(name, sub)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the tables of settings where a page asks for them."""
    return markdown.replace("<!-- settings -->", settings_reference())
