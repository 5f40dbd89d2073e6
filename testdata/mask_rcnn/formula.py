"""Weights and an image that follow from a formula, so that no file has to carry them.

The same formula is in crates/stonewise-testing/src/formula.rs.
"""

import numpy as np

# What makes the outputs of a network of random weights worth comparing: scores that are spread, boxes that move.
GAINS = {
    "rpn.head.cls_logits.weight": 0.7,
    "rpn.head.bbox_pred.weight": 0.3,
    "roi_heads.box_predictor.cls_score.weight": 0.9,
    "roi_heads.box_predictor.bbox_pred.weight": 0.7,
    "roi_heads.mask_predictor.mask_fcn_logits.weight": 2.0,
}


def fnv1a(text):
    h = 2166136261
    for byte in text.encode():
        h = ((h ^ byte) * 16777619) & 0xFFFFFFFF
    return h


def unit(key, count):
    """Numbers in [-1, 1), 24 bits each, from a name and a place."""
    h = (np.arange(count, dtype=np.uint64) * 2654435761 + fnv1a(key)) & 0xFFFFFFFF
    h = ((h ^ (h >> 16)) * 0x45D9F3B) & 0xFFFFFFFF
    h = ((h ^ (h >> 16)) * 0x45D9F3B) & 0xFFFFFFFF
    h = h ^ (h >> 16)
    return (h >> 8).astype(np.float64) / 2**23 - 1.0


def parameter(key, shape):
    """A parameter's values, float32."""
    u = unit(key, int(np.prod(shape)))
    if key.endswith("running_var"):
        values = 1.0 + 0.5 * u
    elif key.endswith("running_mean"):
        values = 0.1 * u
    elif len(shape) == 1 and key.endswith("weight"):
        values = 0.6 + 0.2 * u
    elif len(shape) == 1:
        values = 0.05 * u
    else:
        inputs = shape[0] * 4 if "conv5_mask" in key else int(np.prod(shape[1:]))
        values = GAINS.get(key, 1.0) * np.sqrt(6.0 / inputs) * u
    return values.astype(np.float32).reshape(shape)


def image(width, height):
    """Blocks of colour with a texture, uint8, rows x columns x 3."""
    y, x, c = np.mgrid[0:height, 0:width, 0:3]
    block = (x // 23) * 7 + ((y + 5 * (x // 23)) // 17) * 13
    value = (block * 37 + c * 61) % 160 + (x * 7 + y * 3 + c * 5) % 29 + 20
    edge = ((x % 23) < 2) | (((y + 5 * (x // 23)) % 17) < 2)
    return np.where(edge, 30 + (x + y) % 11, value).astype(np.uint8)


def described(name, output, places):
    """Name, shape, root mean square and the values at row-major places of an array."""
    digits = lambda value: float(f"{value:.7g}")
    return {
        "name": name,
        "shape": list(output.shape),
        "rms": digits(np.sqrt((output.astype(np.float64) ** 2).mean())),
        "places": places.tolist(),
        "values": [digits(v) for v in output.ravel()[places]],
    }
