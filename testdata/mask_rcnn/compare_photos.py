"""Compares torchvision's maskrcnn_resnet50_fpn with ours on photos.

python compare_photos.py OURS OUT PHOTO...   OURS: the built example `instances` of stonewise-segment

Random weights, their batch-norm statistics taken from the photos and their last layers scaled so that scores and boxes are
spread. Masks are compared on the network's grid, and drawn into the image: theirs by PyTorch's grid_sample, because
torchvision's own drawing cuts boxes to whole pixels.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from safetensors.torch import save_file
from torch.nn.functional import grid_sample
from torchvision.models.detection import maskrcnn_resnet50_fpn

LONGEST = 1600
# Random weights also make masks of a pixel or two, about which overlap says nothing.
LEAST_PIXELS = 100


def calibrated(images):
    torch.manual_seed(7)
    model = maskrcnn_resnet50_fpn(weights=None, weights_backbone=None).eval()
    norms = [module for module in model.modules() if isinstance(module, torch.nn.BatchNorm2d)]
    for norm in norms:
        norm.momentum = None
        norm.reset_running_stats()
        norm.train()
    with torch.no_grad():
        for image in images:
            model.backbone(model.transform([image])[0].tensors)
    model.eval()
    heads = model.roi_heads
    for layer, spread in [
        (model.rpn.head.cls_logits, 2.0),
        (model.rpn.head.bbox_pred, 0.3),
        (heads.box_predictor.cls_score, 2.5),
        (heads.box_predictor.bbox_pred, 0.7),
        (heads.mask_predictor.mask_fcn_logits, 3.0),
    ]:
        seen = []
        hook = layer.register_forward_hook(lambda _m, _i, out: seen.append(out.flatten()))
        with torch.no_grad():
            model([images[0]])
            hook.remove()
            layer.weight *= spread / torch.cat(seen).std()
            layer.bias.zero_()
    return model


def drawn(mask, box, height, width):
    """The mask's probabilities at the centres of all pixels."""
    left, top, right, bottom = box
    x = (torch.arange(width) + 0.5 - left) / (right - left) * 2 - 1
    y = (torch.arange(height) + 0.5 - top) / (bottom - top) * 2 - 1
    grid = torch.stack(torch.meshgrid(y, x, indexing="ij")[::-1], -1)
    return grid_sample(mask[None, None], grid[None], align_corners=False)[0, 0] >= 0.5


def main(ours, out, photos):
    out.mkdir(parents=True, exist_ok=True)
    paths, images = [], []
    for i, photo in enumerate(photos):
        image = Image.open(photo).convert("RGB")
        image.thumbnail((LONGEST, LONGEST))
        paths.append(out / f"{i}.png")
        image.save(paths[-1])
        images.append(torch.from_numpy(np.array(image)).permute(2, 0, 1).float() / 255)
    model = calibrated(images)
    weights = {k: v.contiguous() for k, v in model.state_dict().items() if not k.endswith("num_batches_tracked")}
    save_file(weights, out / "weights.safetensors")
    subprocess.run([ours, out / "weights.safetensors", out / "ours.json", *paths], check=True)
    raw = []
    model.roi_heads.mask_predictor.register_forward_hook(lambda _m, _i, logits: raw.append(logits.sigmoid()))
    for path, image, mine in zip(paths, images, json.loads((out / "ours.json").read_text())):
        with torch.no_grad():
            theirs = model([image])[0]
        masks = raw.pop()[torch.arange(len(theirs["labels"])), theirs["labels"]]
        boxes = torch.tensor([m["bounds"] for m in mine])
        classes = torch.tensor([m["class"] for m in mine])
        worst = {"box_px": 0.0, "score": 0.0, "mask": 0.0}
        ious, missing = [], 0
        for box, label, score, mask in zip(theirs["boxes"], theirs["labels"], theirs["scores"], masks):
            distance = (boxes - box).abs().amax(1) + 1e6 * (classes != label)
            place = int(distance.argmin())
            if distance[place] > 2:
                missing += 1
                continue
            m = mine[place]
            worst["box_px"] = max(worst["box_px"], float(distance[place]))
            worst["score"] = max(worst["score"], abs(m["score"] - float(score)))
            worst["mask"] = max(worst["mask"], float((torch.tensor(m["mask"]).view(28, 28) - mask).abs().max()))
            whole = drawn(mask, box, *image.shape[1:])
            # Ours is drawn within the box only.
            part = torch.zeros_like(whole)
            inside = torch.tensor(m["pixels"], dtype=torch.bool).view(-1, m["width"])
            region = (slice(m["top"], m["top"] + inside.shape[0]), slice(m["left"], m["left"] + inside.shape[1]))
            part[region] = inside
            keep = torch.zeros_like(whole)
            keep[region] = True
            whole &= keep
            union = int((part | whole).sum())
            if union >= LEAST_PIXELS:
                ious.append(float((part & whole).sum()) / union)
        print(path.name, f"{len(mine)} ours, {len(theirs['labels'])} theirs, {missing} missing;",
              {k: f"{v:.2g}" for k, v in worst.items()}, f"mask IoU of {len(ious)}: least {min(ious):.4f}, median {np.median(ious):.4f}")


main(sys.argv[1], Path(sys.argv[2]), [Path(p) for p in sys.argv[3:]])
