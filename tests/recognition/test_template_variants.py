"""The best template of every character."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from recognition.template_variants import TemplateVariants


@given(st.lists(st.tuples(st.sampled_from("A8B0O"), st.floats(-1.0, 1.0)), min_size=1, max_size=30))
def test_against_looking_at_each_character(templates: list[tuple[str, float]]) -> None:
    chars, scores = [c for c, _ in templates], np.array([s for _, s in templates])
    copies = TemplateVariants(chars)
    assert list(copies.chars) == sorted(set(chars))
    wanted = [max(s for c, s in templates if c == char) for char in copies.chars]
    np.testing.assert_array_equal(copies.best(scores), wanted)
