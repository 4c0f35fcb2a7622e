"""The public network from which training starts: PP-OCRv6 small, which reads print (in the wheel of `rapidocr`).

    picture (n, 3, ROWS, columns), -1 to 1 --body--> features (n, columns / 8, FEATURES) --head--> 18,710 characters

`onnx2torch` converts it (extra `train`). Its licence is Apache-2.0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor, nn

from glyphs.errors import MarksError

if TYPE_CHECKING:
    from torch.fx import GraphModule

ROWS, FEATURES = 48, 120
STEP_COLUMNS = 8
"""Columns of a picture per step of features."""
_HEAD_NODES = ("MatMul", "Add", "Identity", "Softmax")
"""Last nodes of the graph: they turn features into probabilities of characters."""


@dataclass(frozen=True, eq=False)
class PublicStart:
    """A network that reads print; `rows` are (FEATURES,) weights and bias of each character, "" the blank."""

    body: nn.Module
    rows: dict[str, tuple[Tensor, float]]

    def head(self, characters: Sequence[str]) -> nn.Linear:
        """Make a head for the blank and these characters from rows of the public head; other rows start random."""
        head = nn.Linear(FEATURES, 1 + len(characters))
        with torch.no_grad():
            for k, char in enumerate(["", *characters]):
                if char in self.rows:
                    weights, bias = self.rows[char]
                    head.weight[k] = weights
                    head.bias[k] = bias
        return head


def load_start() -> PublicStart:
    """Load the network of the installed `rapidocr`. Raises MarksError without one of the expected structure."""
    import onnx
    from onnx2torch import convert

    spec = find_spec("rapidocr")
    models = (
        sorted((Path(spec.origin).parent / "models").glob("*v6_rec_small.onnx"))
        if spec and spec.origin
        else []
    )
    if not models:
        raise MarksError(
            "the public network to start from is not installed",
            hint='install rapidocr 3.10 or later: pip install "tactile-marks[train]"',
        )
    model = onnx.load(str(models[0]))
    graph = model.graph
    tail = graph.node[-len(_HEAD_NODES) :]
    if tuple(node.op_type for node in tail) != _HEAD_NODES:
        raise MarksError(f"{models[0].name} does not end in a character head", hint="install rapidocr 3.10")
    arrays = {array.name: onnx.numpy_helper.to_array(array) for array in graph.initializer}
    weights, bias = arrays[tail[0].input[1]], arrays[tail[1].input[1]]
    features = tail[0].input[0]
    del graph.node[-len(_HEAD_NODES) :]
    graph.output[0].name = features
    del graph.output[0].type.tensor_type.shape.dim[:]
    for node in graph.node:
        _pad_by_numbers(node)
    body = convert(model)
    _make_constants_learnable(body)
    _join(body)
    names = ["", *_characters(model), " "]
    return PublicStart(
        body, {c: (torch.from_numpy(weights[:, k].copy()), float(bias[k])) for k, c in enumerate(names)}
    )


def _characters(model: Any) -> list[str]:
    listed = next(property.value for property in model.metadata_props if property.key == "character")
    return str(listed).splitlines()


def _pad_by_numbers(node: Any) -> None:
    from onnx.helper import make_attribute

    for attribute in list(node.attribute):
        if attribute.name == "auto_pad" and attribute.s == b"SAME_UPPER":
            node.attribute.remove(attribute)
            node.attribute.append(make_attribute("pads", [0, 0, 1, 1]))


def _make_constants_learnable(body: nn.Module) -> None:
    for module in body.modules():
        if isinstance(module, nn.BatchNorm2d):
            continue
        for name, value in list(module.named_buffers(recurse=False)):
            if value.dtype.is_floating_point and value.numel() > 1:
                del module._buffers[name]
                module.register_parameter(name, nn.Parameter(value.clone()))


def _join(body: GraphModule) -> None:
    """Leave out copies, and compute each Gelu in one step: training takes less than half the time."""
    modules, graph = dict(body.named_modules()), body.graph
    kinds = {
        node: type(modules[str(node.target)]).__name__ for node in graph.nodes if node.op == "call_module"
    }
    for node in [node for node, kind in kinds.items() if kind == "OnnxCopyIdentity"]:
        node.replace_all_uses_with(node.args[0])  # type: ignore[arg-type]
        graph.erase_node(node)
    body.add_module("gelu", nn.GELU())
    for erf in [node for node, kind in kinds.items() if kind == "OnnxErf"]:
        # x / sqrt(2) -> erf -> + 1 -> * x -> * 0.5
        divided = erf.args[0]
        (plus_one,) = erf.users
        (times_x,) = plus_one.users
        (halved,) = times_x.users
        with graph.inserting_before(halved):
            joined = graph.call_module("gelu", (divided.args[0],))  # type: ignore[union-attr]
        halved.replace_all_uses_with(joined)
        for node in (halved, times_x, plus_one, erf, divided):
            graph.erase_node(node)  # type: ignore[arg-type]
    body.recompile()
