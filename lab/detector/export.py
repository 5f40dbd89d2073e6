"""Writes a trained detector as a safetensors file for `stonewise detector segment --model`, in half precision.

python3 export.py MODEL.pt OUT.safetensors --backbone FILE.pth [--provenance FILE.json]

MODEL.pt is what train_detector.py writes; weights of the backbone that it does not hold are those of the package's
file, batch normalisation folded in.
"""

import argparse
import json
import struct

import torch

from lite import Lite

BODY = "backbone.body."
# Key of the configuration (crates/stonewise-segment/src/model/weights.rs).
CONFIG_KEY = "stonewise_model"


def config(lite, relief):
    """What crates/stonewise-segment/src/model/config.rs calls `MaskRcnnConfig::efficientnet_lite`."""
    sampling = dict(count=256, positive_share=0.5, positive_iou=0.7, negative_iou=0.3)
    return {
        "classes": 2,
        "pixel_mean": [127 / 255] * 3,
        "pixel_std": [128 / 255] * 3,
        "relief_channels": 4 if relief else 0,
        "resize": None,
        "backbone": {"efficientnet_lite": lite},
        "fpn_channels": 96,
        "head_groups": 16,
        "plain_proposals": True,
        "anchors": {"sizes": [[16], [32], [64], [128], [256]], "aspect_ratios": [0.5, 1, 2]},
        "anchor_sampling": sampling,
        "proposals": {"before_nms": [500, 1000], "after_nms": [300, 600], "nms_iou": 0.7},
        "roi": {
            "box_cells": 7,
            "mask_cells": 14,
            "samples": 2,
            "half_pixel": True,
            "box_hidden": 256,
            "mask_channels": [64] * 4,
            "sampling": dict(count=128, positive_share=0.25, positive_iou=0.5, negative_iou=0.5),
        },
        "score_threshold": 0.05,
        "nms_iou": 0.5,
        "detections": 400,
        "min_stone_pixels": 24,
    }


def safetensors(weights, metadata):
    """A file of half-precision tensors: length of the header, header, values."""
    header, parts, end = {"__metadata__": metadata}, [], 0
    for name in sorted(weights):
        values = weights[name].detach().cpu().float().numpy().astype("<f2")
        if not abs(values).max() < float("inf"):
            raise SystemExit(f"{name} has values that half precision cannot hold")
        parts.append(values.tobytes())
        begin, end = end, end + len(parts[-1])
        header[name] = {"dtype": "F16", "shape": list(values.shape), "data_offsets": [begin, end]}
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + b"".join(parts)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("out")
    parser.add_argument("--backbone", required=True)
    parser.add_argument("--provenance", help="what the weights were trained on and how, kept in the file")
    args = parser.parse_args()
    model = torch.load(args.model, map_location="cpu")
    body = Lite(model.get("size", 0)).load_package(args.backbone).state_dict()
    weights = {**{BODY + name: value for name, value in body.items()}, **model["weights"]}
    relief = any(name.startswith("backbone.relief.") for name in weights)
    metadata = {CONFIG_KEY: json.dumps(config(model.get("size", 0), relief), separators=(",", ":"))}
    if args.provenance:
        with open(args.provenance) as file:
            metadata["stonewise_provenance"] = json.dumps(json.load(file))
    with open(args.out, "wb") as file:
        file.write(safetensors(weights, metadata))


if __name__ == "__main__":
    main()
