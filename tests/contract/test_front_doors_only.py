"""The contract suite reaches the program by its front doors alone."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PRODUCT = {"glyphs", "whisker_array", "recognition", "pipeline"}
HERE = Path(__file__).parent


def inner_imports(source: str) -> list[str]:
    """Modules below the four packages that a source imports."""
    names: list[str] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.append(node.module)
    return [name for name in names if "." in name and name.partition(".")[0] in PRODUCT]


def test_inner_imports_are_found() -> None:
    assert inner_imports("import pipeline.cli.main\nfrom glyphs import stamp") == ["pipeline.cli.main"]


@pytest.mark.parametrize("path", sorted(HERE.glob("*.py")), ids=lambda path: path.stem)
def test_only_the_vocabulary_of_the_packages_is_imported(path: Path) -> None:
    assert inner_imports(path.read_text(encoding="utf-8")) == []
