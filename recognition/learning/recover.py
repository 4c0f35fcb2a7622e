"""Recover the torch weights of the recogniser from its eight-bit ONNX file, to train on from them::

    python -m recognition.learning.recover --out start.pt

The numbers of the file are linear in the weights, so two exports give slope and offset of each.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from cyclopts import run
from numpy.typing import NDArray

from glyphs.errors import MarksError
from recognition.learning.network import Recogniser
from recognition.learning.public_start import load_start
from recognition.learning.quantise import prepare
from recognition.learning.train_recogniser import export_float
from recognition.recogniser.recogniser import CHARACTERS

Numbers = NDArray[np.float32]

PUBLISHED = Path(__file__).parents[1] / "recogniser" / "recogniser.onnx"
_GATES = ("7", "33", "47", "61", "81")
"""Numbers of the constants that are the biases of the five squeeze-and-excitation gates, in order."""
_FIRST_JOINED = 54
"""First of the convolutions that the export joins with their normalisation."""


def recover(source: Path = PUBLISHED) -> Recogniser:
    """Return the network whose export is an ONNX file. Raises MarksError for a file of another structure."""
    network = Recogniser(load_start(), CHARACTERS)
    # scales of normalisation multiply the weights before them, so these alone can stand for both
    weights = {name: w for name, w in network.named_parameters() if not _is_scale(name)}
    before = {name: _laid(name, w) for name, w in weights.items()}
    first = _exported(network)
    with torch.no_grad():
        for values in weights.values():
            values += 0.1 * values.abs().mean() + 1e-3
    after, second, wanted = (
        {name: _laid(name, w) for name, w in weights.items()},
        _exported(network),
        _numbers(source),
    )
    for name, values in weights.items():
        key = _key(name, first)
        if key not in wanted or wanted[key].size != values.numel():
            raise MarksError(f"{source.name} holds no {name}", hint="use a file written by this version")
        start, slope = first[key].ravel(), second[key].ravel() - first[key].ravel()
        share = (wanted[key].ravel() - start) / slope
        numbers = before[name] + share * (after[name] - before[name])
        shape = values.T.shape if name == "head.weight" else values.shape
        laid = torch.from_numpy(numbers.astype(np.float32)).reshape(shape)
        with torch.no_grad():
            values.copy_(laid.T if name == "head.weight" else laid)
    return network


def _is_scale(name: str) -> bool:
    return "BatchNormalization" in name and name.endswith("weight")


def _laid(name: str, values: torch.Tensor) -> Numbers:
    laid = values.T if name == "head.weight" else values
    return np.array(laid.detach().numpy(), dtype=np.float32).ravel()


def _key(name: str, exported: Mapping[str, Numbers]) -> str:
    suffix = name.rsplit("_", 1)[-1]
    if suffix in _GATES:
        return f"ConvMulFusion_Mul_B_/body/HardSigmoid/{_GATES.index(suffix)}/Constant_output_0"
    joined = [key for key in exported if key.endswith(name)]
    if joined:
        return joined[0]
    numbered = sorted((key for key in exported if key.startswith("onnx::Conv_")), key=_number)
    if name == "head.weight":
        return next(key for key in exported if key.startswith("onnx::MatMul_"))
    if name.startswith("body.BatchNormalization/"):
        return numbered[2 * _number(name.removesuffix(".bias")) + 1]
    return numbered[2 * (_number(name.removesuffix(".weight")) - _FIRST_JOINED)]


def _number(name: str) -> int:
    return int(re.split(r"[_/]", name)[-1])


def _exported(network: Recogniser) -> dict[str, Numbers]:
    with tempfile.TemporaryDirectory() as folder:
        whole, prepared = Path(folder, "whole.onnx"), Path(folder, "prepared.onnx")
        export_float(network, whole)
        prepare(whole, prepared)
        return _numbers(prepared)


def _numbers(path: Path) -> dict[str, Numbers]:
    import onnx

    constants = {
        tensor.name: onnx.numpy_helper.to_array(tensor) for tensor in onnx.load(str(path)).graph.initializer
    }
    numbers = {name: values for name, values in constants.items() if values.dtype == np.float32}
    for name in constants:
        if name.endswith("_quantized"):
            plain = name.removesuffix("_quantized")
            values = constants[name].astype(np.float32)
            scale = next(constants[key] for key in (f"{name}_scale", f"{plain}_scale") if key in constants)
            numbers[plain] = values * scale.reshape(-1, *(1 for _ in values.shape[1:]))
    # the export counts all nodes: only the order of these numbers says which weights they are
    counted = sorted((name for name in numbers if name.startswith("onnx::")), key=_number)
    names = {name: f"{name.rsplit('_', 1)[0]}_{place}" for place, name in enumerate(counted)}
    return {names.get(name, name): values for name, values in numbers.items()}


def main(*, out: Path, source: Path = PUBLISHED, public_share: float = 0.0) -> None:
    """Write the torch weights of an eight-bit recogniser.

    Args:
        source: ONNX file (default: the recogniser of this program).
        public_share: share of the public network's weights that is mixed in: what these know of print comes back.
    """
    network, public = recover(source), Recogniser(load_start(), CHARACTERS)
    with torch.no_grad():
        for values, known in zip(network.parameters(), public.parameters(), strict=True):
            values.lerp_(known, public_share)
    torch.save(network.state_dict(), out)


if __name__ == "__main__":
    run(main)
