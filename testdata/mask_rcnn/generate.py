"""Makes expected.json: what torchvision's Mask R-CNN finds with the weights and image of formula.py.

python generate.py   (torch 2.11.0, torchvision 0.26.0)
"""

import json
from pathlib import Path

import torch
from formula import image, parameter
from torchvision.models.detection import MaskRCNN
from torchvision.models.detection.anchor_utils import AnchorGenerator
from torchvision.models.detection.backbone_utils import BackboneWithFPN
from torchvision.models.detection.mask_rcnn import MaskRCNNHeads, MaskRCNNPredictor
from torchvision.models.detection.faster_rcnn import FastRCNNPredictor, TwoMLPHead
from torchvision.models import resnet18, resnet50
from torchvision.ops import FrozenBatchNorm2d, MultiScaleRoIAlign

WIDTH, HEIGHT = 150, 110
CHANNELS, CLASSES = 24, 3


def network(make_body, stages):
    norm = lambda channels: FrozenBatchNorm2d(channels, eps=1e-5)
    body = make_body(weights=None, norm_layer=norm)
    backbone = BackboneWithFPN(
        body,
        {f"layer{i}": str(i - 1) for i in range(1, 5)},
        stages,
        CHANNELS,
    )
    align = lambda size: MultiScaleRoIAlign(["0", "1", "2", "3"], output_size=size, sampling_ratio=2)
    model = MaskRCNN(
        backbone,
        num_classes=None,
        rpn_anchor_generator=AnchorGenerator(((8,), (16,), (32,), (64,), (128,)), ((0.5, 1.0, 2.0),) * 5),
        box_roi_pool=align(7),
        box_head=TwoMLPHead(CHANNELS * 49, 32),
        box_predictor=FastRCNNPredictor(32, CLASSES),
        mask_roi_pool=align(14),
        mask_head=MaskRCNNHeads(CHANNELS, (16, 20), 1),
        mask_predictor=MaskRCNNPredictor(20, 20, CLASSES),
        min_size=180,
        max_size=240,
        rpn_pre_nms_top_n_test=200,
        rpn_post_nms_top_n_test=60,
        box_detections_per_img=25,
        box_score_thresh=0.3,
    )
    state = {key: torch.from_numpy(parameter(key, tuple(value.shape))) for key, value in model.state_dict().items()}
    model.load_state_dict(state)
    return model.eval()


def instances(model, pixels):
    """What is found, its masks before they are drawn into the image."""
    masks = []
    model.roi_heads.mask_predictor.register_forward_hook(lambda _m, _i, logits: masks.append(logits.sigmoid()))
    with torch.no_grad():
        found = model([torch.from_numpy(pixels).permute(2, 0, 1).float() / 255])[0]
    raw = masks[0][torch.arange(len(found["labels"])), found["labels"]]
    return [
        {
            "bounds": [round(v, 4) for v in box.tolist()],
            "class": int(label),
            "score": round(float(score), 6),
            # Every 3rd cell of every 3rd row says enough.
            "mask": [round(v, 4) for v in mask[1::3, 1::3].flatten().tolist()],
        }
        for box, label, score, mask in zip(found["boxes"], found["labels"], found["scores"], raw)
    ]


pixels = image(WIDTH, HEIGHT)
expected = {
    "r18": instances(network(resnet18, [64, 128, 256, 512]), pixels),
    "r50": instances(network(resnet50, [256, 512, 1024, 2048]), pixels),
}
for name, found in expected.items():
    print(name, len(found), [round(f["score"], 3) for f in found])
Path(__file__).with_name("expected.json").write_text(json.dumps(expected, separators=(",", ":")) + "\n")
