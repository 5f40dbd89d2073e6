"""Mask R-CNN on frozen EfficientNet-Lite0 with relief joined at the pyramid.

Parts and names are torchvision's where it has them; the differences are those of stonewise's own model:
group normalisation, RoIAlign with half-pixel alignment, soft mask targets, and boxes where nothing is known
are left out of the losses.
"""

import torch
import torch.nn.functional as F
from torch import nn
from torchvision.models.detection.anchor_utils import AnchorGenerator
from torchvision.models.detection.faster_rcnn import FastRCNNPredictor, TwoMLPHead
from torchvision.models.detection.image_list import ImageList
from torchvision.models.detection.mask_rcnn import MaskRCNNHeads, MaskRCNNPredictor
from torchvision.models.detection.roi_heads import RoIHeads, fastrcnn_loss
from torchvision.models.detection.rpn import RegionProposalNetwork, RPNHead
from torchvision.ops import FeaturePyramidNetwork, roi_align
from torchvision.ops.feature_pyramid_network import LastLevelMaxPool

from lite0 import PIXEL_MEAN, PIXEL_STD, TAPS, Lite0

STRIDES = [4, 8, 16, 32]
RELIEF_CHANNELS = 4
RELIEF_WIDTHS = [32, 48, 64, 64]
WIDTH = 96
MASK_WIDTH = 64
BOX_HIDDEN = 256
GROUPS = 16
MASK_CELLS = 14
# A box of whose pixels more than this share are unknown says nothing about background.
MOST_UNKNOWN = 0.5


class Norm(nn.GroupNorm):
    """Group normalisation in single precision."""

    def __init__(self, channels):
        super().__init__(GROUPS, channels)

    def forward(self, x):
        return super().forward(x.float())


class ReliefStem(nn.Module):
    """Relief of half the photo's size to contributions to the pyramid's four levels."""

    def __init__(self):
        super().__init__()
        self.stages, self.laterals = nn.ModuleList(), nn.ModuleList()
        inputs = RELIEF_CHANNELS
        for width in RELIEF_WIDTHS:
            first = nn.Conv2d(inputs, width, 3, 2, 1, bias=False)
            second = nn.Conv2d(width, width, 3, 1, 1, bias=False)
            self.stages.append(nn.Sequential(first, Norm(width), nn.ReLU(), second, Norm(width), nn.ReLU()))
            self.laterals.append(nn.Conv2d(width, WIDTH, 1))
            inputs = width

    def forward(self, relief, present):
        levels = []
        for stage, lateral in zip(self.stages, self.laterals):
            relief = stage(relief)
            levels.append(lateral(relief) * present)
        return levels


class Pyramid(FeaturePyramidNetwork):
    """torchvision's feature pyramid, with something added to each level before the levels are joined."""

    def __init__(self):
        super().__init__(list(TAPS.values()), WIDTH, LastLevelMaxPool(), Norm)

    def forward(self, features, added):
        inner = [block(feature) for block, feature in zip(self.inner_blocks, features)]
        if added is not None:
            inner = [x + y for x, y in zip(inner, added)]
        for level in range(len(inner) - 2, -1, -1):
            above = F.interpolate(inner[level + 1], size=inner[level].shape[-2:], mode="nearest")
            inner[level] = inner[level] + above
        levels = [block(x) for block, x in zip(self.layer_blocks, inner)]
        levels.append(F.max_pool2d(levels[-1], 1, 2, 0))
        return levels


class Backbone(nn.Module):
    def __init__(self):
        super().__init__()
        self.body, self.fpn, self.relief = Lite0(), Pyramid(), ReliefStem()
        self.frozen = True

    def forward(self, images, relief, present):
        with torch.set_grad_enabled(torch.is_grad_enabled() and not self.frozen):
            features = self.body(images)
        added = None
        if relief is not None:
            added = self.relief(relief, present[:, None, None, None])
        return self.fpn(features, added)


class HalfPixelAlign(nn.Module):
    """RoIAlign with 2 x 2 points a cell, half-pixel alignment, and the level by size (eq. 1 of Lin et al.)."""

    def __init__(self, cells, canonical_size=224, canonical_level=2):
        super().__init__()
        self.cells, self.size, self.level = cells, canonical_size, canonical_level

    def forward(self, features, boxes, image_shapes):
        rois = torch.cat([F.pad(b, (1, 0), value=float(i)) for i, b in enumerate(boxes)])
        sides = ((rois[:, 3] - rois[:, 1]) * (rois[:, 4] - rois[:, 2])).clamp(min=1e-6).sqrt()
        levels = torch.floor(self.level + torch.log2(sides / self.size) + 1e-6).clamp(0, 3)
        result = features[0].new_zeros(len(rois), features[0].shape[1], self.cells, self.cells)
        for level, stride in enumerate(STRIDES):
            here = torch.where(levels == level)[0]
            if len(here):
                cells = roi_align(features[level], rois[here], self.cells, 1 / stride, 2, aligned=True)
                result = result.index_put((here,), cells)
        return result


def unknown_share(unknown, boxes):
    """Share of each box that is unknown, from sums over all rectangles from the corner (Crow 1984)."""
    height, width = unknown.shape
    sums = F.pad(unknown.float().cumsum(0).cumsum(1), (1, 0, 1, 0))
    x0, x1 = (boxes[:, i].round().clamp(0, width).long() for i in (0, 2))
    y0, y1 = (boxes[:, i].round().clamp(0, height).long() for i in (1, 3))
    inside = sums[y1, x1] - sums[y0, x1] - sums[y1, x0] + sums[y0, x0]
    return inside / ((x1 - x0) * (y1 - y0)).clamp(min=1)


class ProposalHead(RPNHead):
    """torchvision's, with results in single precision."""

    def forward(self, levels):
        logits, offsets = super().forward(levels)
        return [x.float() for x in logits], [x.float() for x in offsets]


class Proposals(RegionProposalNetwork):
    def assign_targets_to_anchors(self, anchors, targets):
        labels, matched = super().assign_targets_to_anchors(anchors, targets)
        for label, boxes, target in zip(labels, anchors, targets):
            if target["unknown"].any():
                label[(label == 0) & (unknown_share(target["unknown"], boxes) > MOST_UNKNOWN)] = -1
        return labels, matched


def mask_targets(stones, numbers, boxes, cells, points=2):
    """Share of a stone in each cell of its box; `stones` is the image of stone numbers."""
    height, width = stones.shape
    steps = (torch.arange(cells * points) + 0.5) / (cells * points)
    x = (boxes[:, 0:1] + steps * (boxes[:, 2:3] - boxes[:, 0:1])).floor().long()
    y = (boxes[:, 1:2] + steps * (boxes[:, 3:4] - boxes[:, 1:2])).floor().long()
    inside = ((x >= 0) & (x < width))[:, None, :] & ((y >= 0) & (y < height))[:, :, None]
    found = stones[y.clamp(0, height - 1)[:, :, None], x.clamp(0, width - 1)[:, None, :]]
    hits = ((found == numbers[:, None, None]) & inside).float()
    return F.avg_pool2d(hits[:, None], points)[:, 0]


class Heads(RoIHeads):
    """torchvision's heads with soft mask targets."""

    unknown = ()

    def assign_targets_to_proposals(self, proposals, gt_boxes, gt_labels):
        matched, labels = super().assign_targets_to_proposals(proposals, gt_boxes, gt_labels)
        for label, boxes, unknown in zip(labels, proposals, self.unknown):
            if unknown.any():
                label[(label == 0) & (unknown_share(unknown, boxes) > MOST_UNKNOWN)] = -1
        return matched, labels

    def losses(self, features, proposals, targets):
        self.unknown = [target["unknown"] for target in targets]
        proposals, matched, labels, offsets = self.select_training_samples(proposals, targets)
        cells = self.box_head(self.box_roi_pool(features, proposals, None))
        logits, boxes = (x.float() for x in self.box_predictor(cells))
        class_loss, box_loss = fastrcnn_loss(logits, boxes, labels, offsets)

        right = [torch.where(label > 0)[0] for label in labels]
        stones = [boxes[at] for boxes, at in zip(proposals, right)]
        if not any(map(len, stones)):
            return class_loss, box_loss, class_loss * 0
        masks = self.mask_predictor(self.mask_head(self.mask_roi_pool(features, stones, None)))[:, 1]
        wanted = torch.cat([
            mask_targets(t["stones"], t["numbers"][m[at]], b, masks.shape[-1])
            for t, m, at, b in zip(targets, matched, right, stones)
            if len(at)
        ])
        return class_loss, box_loss, F.binary_cross_entropy_with_logits(masks.float(), wanted)

    def find(self, features, proposals, shapes):
        """Boxes, scores and mask probabilities of each image."""
        cells = self.box_head(self.box_roi_pool(features, proposals, None))
        logits, boxes = (x.float() for x in self.box_predictor(cells))
        boxes, scores, _ = self.postprocess_detections(logits, boxes, proposals, shapes)
        cells = self.mask_roi_pool(features, boxes, None)
        masks = self.mask_predictor(self.mask_head(cells))[:, 1].sigmoid()
        return list(zip(boxes, scores, masks.split([len(b) for b in boxes])))


class Detector(nn.Module):
    """Images [batch, 3, rows, columns], 0 to 1, sides multiples of 32; relief of half that size, or none."""

    def __init__(self):
        super().__init__()
        self.backbone = Backbone()
        self.is_fast = False
        anchors = AnchorGenerator([(s,) for s in (16, 32, 64, 128, 256)], [(0.5, 1.0, 2.0)] * 5)
        count = dict(training=500, testing=1000), dict(training=300, testing=600)
        self.rpn = Proposals(anchors, ProposalHead(WIDTH, 3), 0.7, 0.3, 256, 0.5, *count, 0.7)
        self.roi_heads = Heads(
            HalfPixelAlign(7), TwoMLPHead(WIDTH * 49, BOX_HIDDEN), FastRCNNPredictor(BOX_HIDDEN, 2),
            0.5, 0.5, 128, 0.25, None, 0.05, 0.5, 400,
            HalfPixelAlign(MASK_CELLS), MaskRCNNHeads(WIDTH, [MASK_WIDTH] * 4, 1, Norm),
            MaskRCNNPredictor(MASK_WIDTH, MASK_WIDTH, 2),
        )

    def features(self, images, relief, present):
        """Levels of the pyramid; computed in bfloat16 while training, where it takes a third of the time."""
        images = ((images - PIXEL_MEAN) / PIXEL_STD).contiguous(memory_format=torch.channels_last)
        with self.precision():
            return self.backbone(images, relief, present)

    def precision(self):
        return torch.autocast("cpu", torch.bfloat16, enabled=self.training or self.is_fast)

    def losses(self, images, relief, present, targets):
        features = self.features(images, relief, present)
        shapes = [tuple(images.shape[-2:])] * len(images)
        with self.precision():
            proposals, rpn = self.rpn(ImageList(images, shapes), dict(enumerate(features)), targets)
            features = [level.float() for level in features]
            class_loss, box_loss, mask_loss = self.roi_heads.losses(features, proposals, targets)
        return {
            "objectness": rpn["loss_objectness"], "anchor_box": rpn["loss_rpn_box_reg"],
            "class": class_loss, "box": box_loss, "mask": mask_loss,
        }

    @torch.no_grad()
    def find(self, images, relief=None, present=None):
        features = self.features(images, relief, present)
        shapes = [tuple(images.shape[-2:])] * len(images)
        with self.precision():
            proposals, _ = self.rpn(ImageList(images, shapes), dict(enumerate(features)))
            return self.roi_heads.find([level.float() for level in features], proposals, shapes)
