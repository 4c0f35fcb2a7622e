"""Pages of the site that are made from the program itself: commands, settings, library."""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

from pipeline.cli.main import app, whole_help
from pipeline.cli.settings import READING, SERVICE, WORKERS, settings_file

ROOT = Path(__file__).parents[1]
PACKAGES = ("glyphs", "whisker_array", "recognition", "pipeline")
LIBRARY = "reference/library.md"


def on_startup(**_: Any) -> None:
    """Give the command reference the full help of every command."""
    for name in app:
        whole_help(name)
        for sub in app[name]:
            whole_help(name, sub)


def on_config(config: Any) -> Any:
    """List the pages of the library under its entry."""
    (reference,) = (entry["Reference"] for entry in config.nav if "Reference" in entry)
    (place,) = (k for k, entry in enumerate(reference) if entry.get("Library") == LIBRARY)
    pages = [{title: path} for title, path, _ in library_pages()]
    reference[place] = {"Library": [LIBRARY, *pages]}
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add a page for every room of every package."""
    for title, path, names in library_pages():
        package = title.partition(":")[0]
        body = "\n\n".join(f"::: {package}.{name}" for name in names)
        files.append(File.generated(config, path, content=f"# {title}\n\n{body}\n"))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the file of settings where a page asks for it."""
    return markdown.replace("<!-- settings -->", f"```toml\n{settings_file(READING, WORKERS, SERVICE)}```")


def library_pages() -> Iterator[tuple[str, str, list[str]]]:
    """(title, path, names) of every room, from what the packages export."""
    for package in PACKAGES:
        stub = (ROOT / package / "__init__.pyi").read_text(encoding="utf-8")
        rooms: dict[str, list[str]] = {}
        for node in ast.parse(stub).body:
            if isinstance(node, ast.ImportFrom) and node.module:
                rooms.setdefault(node.module.partition(".")[0], []).extend(one.name for one in node.names)
        for room, names in rooms.items():
            yield f"{package}: {room}", f"reference/library/{package}-{room}.md", names
