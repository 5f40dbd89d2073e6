"""Mask R-CNN on EfficientNet-Lite with relief joined at the pyramid.

Parts and names are torchvision's where it has them; the differences are those of stonewise's own model: group
normalisation and RoIAlign with half-pixel alignment. The losses are those of `learning.py`.
"""

import contextlib

import torch
import torch.nn.functional as F
from torch import nn
from torchvision.models.detection.anchor_utils import AnchorGenerator
from torchvision.models.detection.faster_rcnn import FastRCNNPredictor, TwoMLPHead
from torchvision.models.detection.image_list import ImageList
from torchvision.models.detection.mask_rcnn import MaskRCNNHeads, MaskRCNNPredictor
from torchvision.models.detection.roi_heads import RoIHeads
from torchvision.models.detection.rpn import RegionProposalNetwork, RPNHead
from torchvision.ops import FeaturePyramidNetwork, roi_align
from torchvision.ops.feature_pyramid_network import LastLevelMaxPool

from lite import PIXEL_MEAN, PIXEL_STD, Lite

STRIDES = [4, 8, 16, 32]
RELIEF_CHANNELS = 4
RELIEF_WIDTHS = [32, 48, 64, 64]
WIDTH = 96
MASK_WIDTH = 64
BOX_HIDDEN = 256
GROUPS = 16
MASK_CELLS = 14


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

    def __init__(self, channels):
        super().__init__(channels, WIDTH, LastLevelMaxPool(), norm_layer=Norm)

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
    def __init__(self, size):
        super().__init__()
        self.body = Lite(size)
        self.fpn, self.relief = Pyramid(self.body.channels), ReliefStem()

    def forward(self, images, relief, present):
        features = self.body(images)
        added = None if relief is None else self.relief(relief, present[:, None, None, None])
        return self.fpn(features, added)


class HalfPixelAlign(nn.Module):
    """RoIAlign with 2 x 2 points a cell, half-pixel alignment, and the level by size (eq. 1 of Lin et al.), of boxes
    [n, 5] whose first number is the image."""

    def __init__(self, cells, canonical_size=224, canonical_level=2):
        super().__init__()
        self.cells, self.size, self.level = cells, canonical_size, canonical_level

    def forward(self, features, boxes):
        sides = ((boxes[:, 3] - boxes[:, 1]) * (boxes[:, 4] - boxes[:, 2])).clamp(min=1e-6).sqrt()
        levels = torch.floor(self.level + torch.log2(sides / self.size) + 1e-6).clamp(0, 3)
        result = features[0].new_zeros(len(boxes), features[0].shape[1], self.cells, self.cells)
        for level, stride in enumerate(STRIDES):
            here = torch.where(levels == level)[0]
            if len(here):
                cells = roi_align(features[level], boxes[here], self.cells, 1 / stride, 2, aligned=True)
                result = result.index_put((here,), cells)
        return result


class ProposalHead(RPNHead):
    """torchvision's, with results in single precision."""

    def forward(self, levels):
        logits, offsets = super().forward(levels)
        return [x.float() for x in logits], [x.float() for x in offsets]


class Detector(nn.Module):
    """Images [batch, 3, rows, columns], 0 to 1, sides multiples of 32; relief of half that size, or none."""

    def __init__(self, size=0):
        super().__init__()
        self.backbone = Backbone(size)
        self.layout = torch.channels_last
        anchors = AnchorGenerator([(s,) for s in (16, 32, 64, 128, 256)], [(0.5, 1.0, 2.0)] * 5)
        count = dict(training=500, testing=1000), dict(training=300, testing=600)
        self.known_anchors = (0, None, [])
        self.rpn = RegionProposalNetwork(anchors, ProposalHead(WIDTH, 3), 0.7, 0.3, 256, 0.5, *count, 0.7)
        self.roi_heads = RoIHeads(
            HalfPixelAlign(7), TwoMLPHead(WIDTH * 49, BOX_HIDDEN), FastRCNNPredictor(BOX_HIDDEN, 2),
            0.5, 0.5, 128, 0.25, None, 0.05, 0.5, 400,
            HalfPixelAlign(MASK_CELLS), MaskRCNNHeads(WIDTH, [MASK_WIDTH] * 4, 1, Norm),
            MaskRCNNPredictor(MASK_WIDTH, MASK_WIDTH, 2),
        )

    def features(self, images, relief, present):
        """Levels of the pyramid."""
        images = ((images - PIXEL_MEAN) / PIXEL_STD).contiguous(memory_format=self.layout)
        with self.precision():
            return self.backbone(images, relief, present)

    def precision(self):
        """bfloat16 in training on a GPU."""
        is_fast = self.training and next(self.parameters()).is_cuda
        return torch.autocast("cuda", torch.bfloat16) if is_fast else contextlib.nullcontext()

    def anchors(self, features, side):
        """Anchors [count, 4] of square images, and how many there are at each level."""
        if self.known_anchors[0] != side:
            sizes = [(side, side)]
            anchors = self.rpn.anchor_generator(ImageList(features[0].new_zeros(1, 3, side, side), sizes), features)
            shapes = self.rpn.anchor_generator.num_anchors_per_location()
            counts = [n * level.shape[2] * level.shape[3] for n, level in zip(shapes, features)]
            self.known_anchors = side, anchors[0].float(), counts
        return self.known_anchors[1:]
