import string

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.fonts.serials import FormatError, allowed_characters, random_text

formats = st.text("A9*BZ-./0", min_size=1, max_size=12)


def test_mask_letters():
    letters, figures = string.ascii_uppercase, string.digits
    assert allowed_characters("A9*-") == (letters, figures, letters + figures, "-")
    assert allowed_characters(r"a-\a\A\\") == (string.ascii_lowercase, "-", "a", "A", "\\")
    assert allowed_characters("B0") == ("B", "0")
    assert "O" not in allowed_characters("A", exclude="IOQ")[0]
    assert allowed_characters("O", exclude="IOQ") == ("O",)


@given(format=formats, seed=st.integers(0, 2**32 - 1))
def test_random_text_obeys_its_mask_and_its_seed(format, seed):
    text = random_text(format, rng=np.random.default_rng(seed), exclude="IOQ")
    assert len(text) == len(format)
    assert all(
        c in allowed for c, allowed in zip(text, allowed_characters(format, exclude="IOQ"), strict=True)
    )
    assert text == random_text(format, rng=np.random.default_rng(seed), exclude="IOQ")


@pytest.mark.parametrize(
    ("format", "exclude", "message"),
    [("", "", "empty"), ("A\n", "", "printed"), ("A9", string.digits, "position 2"), ("A\\", "", "follows")],
)
def test_masks_refused(format, exclude, message):
    with pytest.raises(FormatError, match=message):
        allowed_characters(format, exclude=exclude)
