"""Makes expected.json: what the detector of lab/detector/model.py computes with the weights and image of
../mask_rcnn/formula.py.

python generate.py   (PyTorch 1.13, torchvision 0.14)
"""

import json
import sys
from pathlib import Path

import numpy as np
import torch

HERE = Path(__file__).parent
sys.path += [str(HERE.parent / "mask_rcnn"), str(HERE.parents[1] / "lab" / "detector")]
from export import config
from formula import described, image, parameter, unit
from model import Detector

WIDTH, HEIGHT = 128, 96
VALUES = 12
# RoIAlign takes the last two from other levels than the first three.
BOXES = [[3, 4, 40, 30], [20.5, 10.2, 90.1, 60.7], [70, 33, 127, 95], [-20, -10, 140, 106], [-100, -60, 230, 180]]


def outputs():
    """A batch of the same image twice, the second time without relief."""
    model = Detector().eval()
    model.load_state_dict({k: torch.from_numpy(parameter(k, tuple(v.shape))) for k, v in model.state_dict().items()})
    pixels = torch.from_numpy(image(WIDTH, HEIGHT).astype(np.float32) / 255).permute(2, 0, 1)
    shape = 4, HEIGHT // 2, WIDTH // 2
    relief = torch.from_numpy(unit("relief", int(np.prod(shape))).astype(np.float32).reshape(shape))
    present = torch.tensor([1.0, 0.0])
    with torch.no_grad():
        levels = model.features(torch.stack([pixels] * 2), torch.stack([relief] * 2), present)
        logits, offsets = model.rpn.head(levels)
        flat = lambda parts: torch.cat([x.permute(0, 2, 3, 1).flatten(1) for x in parts], 1)
        boxes = torch.cat([torch.cat([torch.full((len(BOXES), 1), i), torch.tensor(BOXES)], 1) for i in (0.0, 1.0)])
        heads = model.roi_heads
        classes, shifts = heads.box_predictor(heads.box_head(heads.box_roi_pool(levels, boxes)))
        masks = heads.mask_predictor(heads.mask_head(heads.mask_roi_pool(levels, boxes)))
    named = {f"level {i}": level for i, level in enumerate(levels)}
    named.update({"proposal logits": flat(logits), "proposal offsets": flat(offsets)})
    return {**named, "class logits": classes, "box offsets": shifts, "mask logits": masks}


def places(name, output):
    """As many of the first image as of the second."""
    half = output.size // 2
    return ((unit(name, VALUES) + 1) / 2 * half).astype(int) + half * (np.arange(VALUES) % 2)


found = {name: output.numpy() for name, output in outputs().items()}
lines = [json.dumps(described(name, output, places(name, output))) for name, output in found.items()]
(HERE / "expected.json").write_text(
    f'{{"config": {json.dumps(config(0, True))},\n"boxes": {json.dumps(BOXES)},\n"outputs": [\n'
    + ",\n".join(lines) + "\n]}\n"
)
