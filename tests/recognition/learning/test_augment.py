"""What happens to strips while they are learned from."""

from __future__ import annotations

import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

import torch
from torch import Tensor

from recognition.learning.augment import augment, noisy
from recognition.learning.training_strips import TALL_ROWS
from recognition.views.text_line import ROWS
from recognition.views.view import EDGES, GREY, HEIGHTS, KNOWN, LAYERS


def strips(seed: int, *, felt: bool = True) -> tuple[Tensor, Tensor]:
    """Four strips of random layers, two of them shorter."""
    rng = torch.Generator().manual_seed(seed)
    tall, columns = torch.zeros(4, LAYERS, TALL_ROWS, 160), torch.tensor([160, 160, 120, 120])
    layers = [HEIGHTS, *range(EDGES, KNOWN)] if felt else [GREY]
    for row, wide in enumerate(columns.tolist()):
        tall[row, layers, :, :wide] = 0.1 + 0.2 * torch.rand(len(layers), TALL_ROWS, wide, generator=rng)
        tall[row, KNOWN, :, :wide] = 1.0
    return tall, columns


def generator(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


@pytest.mark.parametrize("easy", [True, False])
def test_strips_are_cut_to_the_recognisers_rows_and_the_same_from_the_same_seed(easy: bool) -> None:
    made = augment(*strips(0), rng=generator(3), easy=easy)
    assert made.shape[:3] == (4, LAYERS, ROWS)
    assert made.shape[3] % 4 == 0
    assert made.isfinite().all()
    torch.testing.assert_close(augment(*strips(0), rng=generator(3), easy=easy), made, atol=0.0, rtol=0.0)
    if not easy:
        assert not torch.equal(augment(*strips(0), rng=generator(4), easy=easy), made[..., : made.shape[3]])


def test_an_easy_cut_is_plain() -> None:
    tall, columns = strips(1)
    made = augment(tall, columns, rng=generator(0), easy=True)
    up = (TALL_ROWS - ROWS) // 2
    # a margin of 0.4 heights, 11.2 columns, is cut off: the strip lies between two of its own columns
    lower, upper = (torch.minimum, torch.maximum)
    one, other = tall[0, :, up : up + ROWS, 11:131], tall[0, :, up : up + ROWS, 12:132]
    assert (made[0, :, :, :120] >= lower(one, other) - 1e-4).all()
    assert (made[0, :, :, :120] <= upper(one, other) + 1e-4).all()


def test_what_is_not_there_is_not_made_up() -> None:
    for felt, missing in ((True, [GREY]), (False, [HEIGHTS, *range(EDGES, KNOWN)])):
        tall, _ = strips(2, felt=felt)
        for seed in range(6):
            made = noisy(tall.clone(), rng=generator(seed))
            assert not made[:, missing].any()
            # nor where nothing is known
            assert not (made * (1.0 - made[:, KNOWN:])).any()
            assert (made[:, KNOWN] <= tall[:, KNOWN]).all()


def test_something_is_always_left_to_read() -> None:
    tall, _ = strips(3)
    for seed in range(40):
        made = noisy(tall.clone(), rng=generator(seed))
        left = made[:, [HEIGHTS, *range(EDGES, KNOWN)]].abs().amax(dim=(1, 2, 3))
        assert (left > 0.0).all(), f"seed {seed}"
