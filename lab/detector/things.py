"""Painted things that are not stones but have the shapes of stones: doors, windows, shutters, stairs, signs.

Each is painted upright in colours 0 to 1, then seen slightly from one side, in its own light.
"""

import numpy as np
from PIL import Image


def smooth_noise(rng, height, width, cell, stretch=(1, 1)):
    """Noise with mean 0 and spread 1 of about `cell` pixels across, longer by `stretch` down and along."""
    size = [max(2, int(np.ceil(n / (cell * s)))) for n, s in zip((height, width), stretch)]
    values = Image.fromarray(rng.normal(0, 1, size).astype(np.float32))
    return np.asarray(values.resize((width, height), Image.BICUBIC))


def paint_colour(rng):
    """Wood, bare or painted, or metal."""
    kinds = [
        (0.32, 0.20, 0.12), (0.45, 0.30, 0.18), (0.20, 0.13, 0.09), (0.60, 0.48, 0.34), (0.50, 0.47, 0.43),
        (0.15, 0.28, 0.20), (0.20, 0.28, 0.42), (0.45, 0.13, 0.10), (0.85, 0.84, 0.80), (0.25, 0.25, 0.26),
    ]
    colour = np.array(kinds[rng.integers(len(kinds))]) * np.exp(rng.normal(0, 0.25))
    return (colour * np.exp(rng.normal(0, 0.08, 3))).clip(0.01, 1).astype(np.float32)


def grid(rng, height, width):
    """Row and column coordinates of the pixels' centres."""
    return np.arange(height, dtype=np.float32)[:, None] + 0.5, np.arange(width, dtype=np.float32)[None] + 0.5


def cells(x, count, length):
    """For pixels along a line of equal cells: number of the cell, and distance from its nearer edge in pixels."""
    at = x / length * count
    number = np.floor(at).clip(0, count - 1)
    return number.astype(int), np.minimum(at - number, number + 1 - at) * length / count


def boards(rng, height, width):
    """A door or a wall of vertical or horizontal boards, perhaps with bands or a lattice of iron and with nails."""
    y, x = grid(rng, height, width)
    count = int(rng.integers(3, 14))
    is_upright = rng.random() < 0.7
    number, edge = cells(x if is_upright else y, count, width if is_upright else height)
    tone = np.exp(rng.normal(0, rng.uniform(0.02, 0.25), count)).astype(np.float32)[number]
    gap = 1 - rng.uniform(0.2, 0.9) * np.exp(-edge / rng.uniform(0.5, 2.0))
    grain = smooth_noise(rng, height, width, 2.5, (12, 1) if is_upright else (1, 12))
    value = tone * gap * (1 + rng.uniform(0.02, 0.2) * grain)
    colour = value[..., None] * paint_colour(rng)
    if rng.random() < 0.5:
        iron = paint_colour(rng) * rng.uniform(0.3, 1.0)
        pitch, thick = rng.uniform(0.08, 0.5) * min(height, width), rng.uniform(0.04, 0.16)
        if rng.random() < 0.6:
            lines = [x + y, x - y]
        else:
            lines = [np.broadcast_to(y, (height, width)), np.broadcast_to(x, (height, width))]
        lines = lines[: rng.integers(1, 3)]
        away = [np.abs((line / pitch) % 1 - 0.5) for line in lines]
        band = np.min(away, 0) < thick
        light = 1 + 0.5 * ((np.min(away, 0) > 0.7 * thick) & band)
        colour = np.where(band[..., None], iron * light[..., None], colour)
        if rng.random() < 0.6:
            knob = np.sum([np.square(a) for a in away], 0) < np.square(0.7 * thick)
            colour = np.where(knob[..., None], colour * rng.uniform(1.1, 2.0), colour)
    return colour


def panels(rng, height, width):
    """A door or a ceiling of framed panels; each edge is lit or in shade."""
    y, x = grid(rng, height, width)
    rows, columns = int(rng.integers(1, 7)), int(rng.integers(1, 5))
    _, from_row = cells(y, rows, height)
    _, from_column = cells(x, columns, width)
    frame = rng.uniform(0.06, 0.2) * min(height / rows, width / columns)
    bevel = max(1.0, rng.uniform(0.2, 0.7) * frame)
    depth = np.minimum(from_row, from_column) - frame
    value = np.ones((height, width), np.float32)
    on_bevel = (depth > 0) & (depth < bevel)
    upper = (y / height * rows) % 1 < 0.5
    left = (x / width * columns) % 1 < 0.5
    is_lit = np.where(from_row < from_column, upper, left) ^ (rng.random() < 0.5)
    strength = rng.uniform(0.1, 0.5)
    value = np.where(on_bevel, np.where(is_lit, 1 + strength, 1 - strength), value)
    value = value * (1 + rng.uniform(0.01, 0.12) * smooth_noise(rng, height, width, 3, (8, 1)))
    return value[..., None] * paint_colour(rng)


def window(rng, height, width):
    """Panes between bars: dark, or with the sky in them; bars light or dark."""
    y, x = grid(rng, height, width)
    rows, columns = int(rng.integers(1, 8)), int(rng.integers(1, 6))
    row, from_row = cells(y, rows, height)
    column, from_column = cells(x, columns, width)
    glass = np.array([0.05, 0.06, 0.07]) * rng.uniform(0.3, 3.0)
    sky = np.array([0.55, 0.65, 0.8]) * rng.uniform(0.2, 1.2)
    tilt = rng.uniform(0, 1, (rows, columns))[row, column] * rng.uniform(0, 1)
    share = (rng.uniform(0, 0.8) * (1 - y / height) + 0.15 * smooth_noise(rng, height, width, 25) + 0.3 * tilt).clip(0, 1)
    colour = glass + share[..., None] * (sky - glass)
    bar = max(1.0, rng.uniform(0.03, 0.12) * min(height / rows, width / columns))
    is_bar = np.minimum(from_row, from_column) < bar
    wood = paint_colour(rng) if rng.random() < 0.6 else np.full(3, rng.uniform(0.6, 0.95))
    return np.where(is_bar[..., None], wood * (1 - 0.3 * (from_row < 0.4 * bar))[..., None], colour)


def slats(rng, height, width):
    """Shutters, louvres, corrugated sheets, gratings."""
    y, x = grid(rng, height, width)
    is_level = rng.random() < 0.7
    line = np.broadcast_to(y if is_level else x, (height, width))
    pitch = rng.uniform(3, 24)
    phase = (line / pitch) % 1
    if rng.random() < 0.5:
        value = 0.5 + 0.6 * phase
    else:
        value = 0.8 + 0.4 * np.sin(2 * np.pi * phase)
    value = value * (1 + 0.04 * smooth_noise(rng, height, width, 4))
    return value[..., None] * paint_colour(rng)


def stairs(rng, height, width):
    """Steps seen from the front: light treads, darker risers, no upright joints."""
    y, _ = grid(rng, height, width)
    count = int(rng.integers(2, 9))
    edges = np.cumsum(rng.uniform(0.7, 1.0, count) * np.linspace(1, rng.uniform(0.5, 1.0), count))
    at = np.interp(y[:, 0], np.concatenate([[0], edges / edges[-1] * height]), np.arange(count + 1))
    phase = at % 1
    tread = rng.uniform(0.15, 0.6)
    value = np.where(phase < tread, 1.0, rng.uniform(0.45, 0.9))[:, None]
    value = value * (1 - 0.5 * np.exp(-np.abs(phase - tread) * height / count / 1.5))[:, None]
    texture = 0.08 * smooth_noise(rng, height, width, 2) + 0.1 * smooth_noise(rng, height, width, 30)
    stone = np.array([0.55, 0.52, 0.47]) * np.exp(rng.normal(0, 0.3)) * np.exp(rng.normal(0, 0.05, 3))
    return (value * (1 + rng.uniform(0.3, 1.5) * texture))[..., None] * stone


def sign(rng, height, width):
    """A plate, a poster, a target: a plain colour with lines of writing or a figure."""
    y, x = grid(rng, height, width)
    colour = np.broadcast_to(rng.uniform(0.05, 1, 3), (height, width, 3))
    ink = rng.uniform(0, 1, 3)
    rows = int(rng.integers(2, 9))
    row, from_row = cells(y, rows, height)
    strokes = smooth_noise(rng, rows, width, 3)[row[:, 0]] > rng.uniform(-0.3, 0.8)
    inside = (x > 0.1 * width) & (x < 0.9 * width)
    writing = (from_row > 0.25 * height / rows) & strokes & inside
    if rng.random() < 0.3:
        writing = (x < width / 2) ^ (y < height / 2)
    return np.where(writing[..., None], ink, colour)


KINDS = [boards, boards, panels, window, window, slats, stairs, sign]


def corners(rng, height, width):
    """How a rectangle looks slightly from one side: coefficients of `Image.transform`, and the size of the result."""
    source = np.array([[0, 0], [width, 0], [width, height], [0, height]], float)
    seen = source + rng.uniform(-0.08, 0.08, (4, 2)) * [width, height]
    seen -= seen.min(0)
    rows = []
    for (x, y), (u, v) in zip(seen, source):
        rows.append([x, y, 1, 0, 0, 0, -u * x, -u * y])
        rows.append([0, 0, 0, x, y, 1, -v * x, -v * y])
    coefficients = np.linalg.solve(np.array(rows), source.ravel())
    size = np.ceil(seen.max(0)).astype(int)
    return coefficients, (max(1, int(size[0])), max(1, int(size[1])))


def thing(rng, side):
    """Colours 0 to 255 and mask of a thing to be seen in a photo of `side` pixels; at most that large."""
    height = int(side * rng.uniform(0.15, 0.85))
    width = int(height * np.exp(rng.uniform(-1.0, 0.7)))
    width = max(16, min(width, int(0.8 * side)))
    colour = KINDS[rng.integers(len(KINDS))](rng, height, width)
    y, x = grid(rng, height, width)
    dirt = np.exp(rng.uniform(0, 0.3) * smooth_noise(rng, height, width, 40))
    light = 1 + rng.uniform(-0.3, 0.3) * (y / height - 0.5) + rng.uniform(-0.2, 0.2) * (x / width - 0.5)
    # The lintel and one reveal cast a shadow.
    shade = np.where(y < rng.uniform(0, 0.25) * height, rng.uniform(0.3, 0.9), 1.0)
    shade = shade * np.where(x < rng.uniform(0, 0.15) * width, rng.uniform(0.4, 1.0), 1.0)
    colour = colour * (light * dirt * shade * np.exp(rng.normal(0, 0.3)))[..., None]
    colour = (255 * np.sqrt(colour.clip(0, 1))).astype(np.uint8) if rng.random() < 0.3 else (255 * colour.clip(0, 1)).astype(np.uint8)
    mask = np.full((height, width), 255, np.uint8)
    if rng.random() < 0.3:
        # A round arch at the top.
        radius = width / 2
        above = radius - y
        mask[(above > 0) & (np.square(x - radius) + np.square(above) > radius * radius)] = 0
    coefficients, size = corners(rng, height, width)
    layers = [Image.fromarray(a).transform(size, Image.PERSPECTIVE, coefficients, Image.BILINEAR) for a in (colour, mask)]
    return np.asarray(layers[0]), np.asarray(layers[1]) > 127
