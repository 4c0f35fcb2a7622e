"""What happens to strips while they are learned from."""

from __future__ import annotations

import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

import torch
from torch import Tensor

from recognition.learning.augment import add_noise, augment
from recognition.learning.network import COLUMNS
from recognition.learning.training_samples import TALL_ROWS
from recognition.see.text_line import ROWS
from recognition.see.view import EDGES, GREY, HEIGHTS, KNOWN, LAYERS


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


def test_strips_are_cut_to_the_recognisers_rows_and_the_same_from_the_same_seed() -> None:
    augmented = augment(*strips(0), rng=generator(3))
    assert augmented.shape[:3] == (4, LAYERS, ROWS)
    assert augmented.shape[3] % COLUMNS == 0
    assert augmented.isfinite().all()
    torch.testing.assert_close(augment(*strips(0), rng=generator(3)), augmented, atol=0.0, rtol=0.0)
    assert not torch.equal(augment(*strips(0), rng=generator(4)), augmented[..., : augmented.shape[3]])


def test_what_is_not_there_is_not_made_up() -> None:
    for felt, missing in ((True, [GREY]), (False, [HEIGHTS, *range(EDGES, KNOWN)])):
        tall, _ = strips(2, felt=felt)
        for seed in range(6):
            augmented = add_noise(tall.clone(), rng=generator(seed))
            assert not augmented[:, missing].any()
            # nor where nothing is known
            assert not (augmented * (1.0 - augmented[:, KNOWN:])).any()
            assert (augmented[:, KNOWN] <= tall[:, KNOWN]).all()


def test_something_is_always_left_to_read() -> None:
    tall, _ = strips(3)
    for seed in range(40):
        augmented = add_noise(tall.clone(), rng=generator(seed))
        left = augmented[:, [HEIGHTS, *range(EDGES, KNOWN)]].abs().amax(dim=(1, 2, 3))
        assert (left > 0.0).all(), f"seed {seed}"
