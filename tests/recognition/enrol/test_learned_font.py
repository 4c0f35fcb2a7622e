import numpy as np
import pytest

from glyphs.fonts.outlines import load_font
from recognition.enrol.exemplars import ExemplarError
from recognition.enrol.learned_font import learn_font, likeness
from recognition.glyph_match.predicted import predict_templates, template_key
from tests.support.felt import blow, drawn

GOTHIC = load_font("gothic")


def learned(text, *, known=(GOTHIC,), more=()):
    chars, reliefs = list(text), [blow(c, k, GOTHIC) for k, c in enumerate(text)]
    for char, relief in more:
        chars.append(char)
        reliefs.append(relief)
    return learn_font("press", chars, reliefs, known=known)


def test_a_font_is_recovered_from_its_own_blows(gothic, touch):
    """Templates of what was learned are those of the font that was stamped."""
    learned_font = learned("K7B2" * 4)
    assert learned_font.set_aside == ()
    key = template_key(gothic, touch, height_mm=5.0)
    truth = predict_templates(gothic, "K7B2", key)
    felt = predict_templates(learned_font.font, "K7B2", template_key(learned_font.font, touch, height_mm=5.0))
    assert felt.half_width == pytest.approx(truth.half_width, abs=0.03)
    rows, cols = (
        min(a, b) // 2 for a, b in zip(truth.patches.shape[2:], felt.patches.shape[2:], strict=True)
    )
    for one, two in zip(truth.patches, felt.patches, strict=True):
        middles = [np.array(p.shape[1:]) // 2 for p in (one, two)]
        same = [
            p[:, m[0] - rows : m[0] + rows + 1, m[1] - cols : m[1] + cols + 1]
            for p, m in zip((one, two), middles, strict=True)
        ]
        # the grid of a fortieth of the height blunts edges a little
        assert likeness(*same) > 0.9


def test_characters_never_felt_come_from_the_nearest_font():
    learned_font = learned("K7B2", known=(load_font("timesr"), GOTHIC))
    assert learned_font.hand.font is GOTHIC
    assert learned_font.hand.is_own
    assert "Q" in learned_font.never_felt
    assert "K" not in learned_font.never_felt
    assert likeness(learned_font.font.glyphs["Q"].relief, drawn("Q", GOTHIC)) > 0.9
    # blows of the font itself: its other characters are no guesses
    assert not any(g.guessed for g in learned_font.font.glyphs.values())


def test_after_a_font_that_is_only_like_it_they_are_guesses():
    learned_font = learned("K7B2", known=(load_font("timesr"),))
    assert not learned_font.hand.is_own
    assert [c for c in "K7B2Q" if learned_font.font.glyphs[c].guessed] == ["Q"]


@pytest.mark.parametrize("place", [0, 2, 4])
def test_one_wrong_exemplar_among_siblings_is_set_aside(place):
    """Whichever came first: a 3 enrolled as an 8 by a slip of the reviewer changes nothing."""
    chars = ["8"] * 5 + ["3"] * 3
    reliefs = [blow(c, k, GOTHIC) for k, c in enumerate(chars)]
    right = learn_font("press", chars, reliefs, known=(GOTHIC,))
    chars.insert(place, "8")
    reliefs.insert(place, blow("L", 77, GOTHIC))
    slipped = learn_font("press", chars, reliefs, known=(GOTHIC,))
    assert slipped.set_aside == (place,)
    assert likeness(slipped.font.glyphs["8"].relief, right.font.glyphs["8"].relief) > 0.999


def test_of_two_that_disagree_the_nearest_font_tells_which():
    learned_font = learned("888KK7722", more=[("B", blow("K", 1, GOTHIC)), ("B", blow("B", 2, GOTHIC))])
    assert learned_font.set_aside == (9,)
    assert likeness(learned_font.font.glyphs["B"].relief, drawn("B", GOTHIC)) > 0.85


def test_a_single_exemplar_of_another_character_teaches_nothing():
    learned_font = learned("888KK7722", more=[("B", blow("7", 1, GOTHIC))])
    assert learned_font.set_aside == (9,)
    assert "B" in learned_font.never_felt
    assert likeness(learned_font.font.glyphs["B"].relief, drawn("B", GOTHIC)) > 0.9


def test_what_cannot_be_learned_is_told():
    with pytest.raises(ExemplarError, match="no known font"):
        learn_font("press", ["K"], [drawn("K", GOTHIC)], known=())
    with pytest.raises(ExemplarError, match="differ in size"):
        learn_font("press", ["K", "K"], [drawn("K", GOTHIC), drawn("K", GOTHIC)[1:]], known=(GOTHIC,))
