"""Makes expected.json: what the stem and every block of EfficientNet-Lite0 compute with the weights and image of
../mask_rcnn/formula.py.

python generate.py   (efficientnet-lite-pytorch 0.1.0, PyTorch 1.13)
"""

import json
import sys
from pathlib import Path

import numpy as np
import torch
from efficientnet_lite_pytorch import EfficientNet

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "mask_rcnn"))
from formula import described, image, parameter, unit

WIDTH, HEIGHT = 96, 64
VALUES = 12


def outputs():
    """Outputs [channels, rows, columns] of the stem and the blocks, in single precision."""
    model = EfficientNet.from_name("efficientnet-lite0").eval()
    state = {
        key: torch.from_numpy(parameter(key, tuple(value.shape))) if value.dim() else value
        for key, value in model.state_dict().items()
    }
    model.load_state_dict(state)
    pixels = torch.from_numpy(image(WIDTH, HEIGHT).astype(np.float32)).permute(2, 0, 1)
    seen = []
    keep = lambda _module, _inputs, output: seen.append(output[0].numpy())
    model._blocks[0].register_forward_pre_hook(lambda _module, inputs: seen.append(inputs[0][0].numpy()))
    for block in model._blocks:
        block.register_forward_hook(keep)
    with torch.no_grad():
        model.extract_features(((pixels - 127) / 8)[None])
    return seen


def places(name, output):
    return ((unit(name, VALUES) + 1) / 2 * output.size).astype(int)


names = ["stem"] + [f"block {i}" for i in range(16)]
lines = [json.dumps(described(name, output, places(name, output))) for name, output in zip(names, outputs(), strict=True)]
(HERE / "expected.json").write_text("[\n" + ",\n".join(lines) + "\n]\n")
