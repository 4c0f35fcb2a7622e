"""Fonts in installed packages: found by package and file, and checked by their hash."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from glyphs.fonts.glyph import FontError
from pipeline.common.version import file_sha256


class PackagedFont(BaseModel):
    """A font file of an installed package; a file with another hash is another font."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    package: str
    version: str
    file: str
    sha256: str


def font_file(font: str, packaged: Mapping[str, PackagedFont]) -> str | Path:
    """The file of a packaged font; any other font unchanged. Raises FontError: no such package or file."""
    if font not in packaged:
        return font
    wanted = packaged[font]
    try:
        path = Path(str(distribution(wanted.package).locate_file(wanted.file)))
    except PackageNotFoundError as error:
        raise FontError(
            f"the font {font} comes with the package {wanted.package}, which is not installed",
            hint=f'install it with: pip install "{wanted.package}=={wanted.version}"; '
            'all fonts of the editions, with: pip install "tactile-marks[exam]"',
        ) from error
    if not path.is_file() or file_sha256(path) != wanted.sha256:
        raise FontError(
            f"{wanted.file} of the package {wanted.package} is not the font that the design names",
            hint=f'install its version: pip install "{wanted.package}=={wanted.version}"',
        )
    return path


def font_mark(font: str, packaged: Mapping[str, PackagedFont]) -> str:
    """The font's name, with a hash of its file: another file of the same name is another font."""
    path = Path(font_file(font, packaged))
    return f"{path.name} {file_sha256(path)[:12]}" if path.is_file() else font
