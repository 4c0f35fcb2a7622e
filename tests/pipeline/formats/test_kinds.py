"""Files that are not finished yet: told by their names and their ends, without decoding them."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from PIL import Image

from pipeline.formats.kinds import PHOTO_SUFFIXES, READ, is_cut_short, is_temporary

KINDS = ("PNG", "JPEG", "BMP", "WEBP")
ENDINGS = ("part", "partial", "filepart", "crdownload", "tmp", "download", "!ut", "1", "inprogress", "a1B2c3")


def picture(kind: str) -> bytes:
    """A picture of noise; a JPEG has a preview, which ends as the picture does."""
    noise = Image.fromarray(np.random.default_rng(3).integers(0, 255, (60, 80, 3), dtype=np.uint8))
    stream, preview = io.BytesIO(), io.BytesIO()
    noise.save(preview, "JPEG")
    more = {"exif": b"Exif\0\0" + preview.getvalue()} if kind == "JPEG" else {}
    noise.save(stream, kind, **more)
    return stream.getvalue()


PICTURES = {kind: picture(kind) for kind in KINDS}


@pytest.mark.parametrize("kind", [kind.name for kind in READ])
def test_a_whole_picture_is_not_cut_short(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "whole"
    path.write_bytes(picture(kind))
    assert not is_cut_short(path)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(kind=st.sampled_from(KINDS), share=st.floats(0.0, 0.99))
def test_a_picture_whose_end_is_missing_is_cut_short(tmp_path: Path, kind: str, share: float) -> None:
    path = tmp_path / "cut"
    whole = PICTURES[kind]
    # the end mark itself may stand before the last bytes
    cut = whole[: int(share * (len(whole) - 16))]
    assume(b"\xff\xd9" not in cut[-4:])  # just where a preview has ended nothing is known
    path.write_bytes(cut)
    assert is_cut_short(path)


@given(st.sampled_from(PHOTO_SUFFIXES), st.sampled_from(ENDINGS), st.booleans())
def test_unfinished_uploads_have_temporary_names_and_photographs_have_none(
    suffix: str, ending: str, upper: bool
) -> None:
    name = f"tray 7.part-3{suffix.upper() if upper else suffix}"
    assert not is_temporary(name)
    for temporary in (f"{name}.{ending}", f".{name}", f"~{name}", f"{name}~", f".{name}.{ending}"):
        assert is_temporary(temporary)
