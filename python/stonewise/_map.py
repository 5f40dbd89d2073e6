"""The map of a result as a picture."""

from __future__ import annotations

import sqlite3
import struct
from contextlib import closing
from pathlib import Path

import numpy as np

WIDTH_PX = 720
FEWEST_MM = 1.0
"""Smallest motion that has the full colour: noise alone must not."""
RED, BLUE, GREY = (178, 24, 43), (33, 102, 172), "#ddd"
BYTES_OF_ENVELOPE = (0, 32, 48, 48, 64)


def opened(path: Path) -> sqlite3.Connection:
    """A GeoPackage, for reading alone."""
    return sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)


def svg(path: Path) -> str:
    """The unrolled wall of a ``stones.gpkg``: every stone in the colour of its motion out of the wall (red) or into it (blue), grey without
    one, with its numbers as a tooltip. Empty where there is no such layer."""
    if not path.is_file():
        return ""
    with closing(opened(path)) as base:
        if not base.execute("SELECT 1 FROM gpkg_contents WHERE table_name = 'stones_facade'").fetchone():
            return ""
        rows = base.execute(
            "SELECT stone_id, status, 1e3 * d_out, 1e3 * lod95, geom FROM stones_facade WHERE geom IS NOT NULL"
        ).fetchall()
    if not rows:
        return ""
    rings = [_ring(row[-1]) for row in rows]
    corners = np.concatenate(rings)
    (left, low), (right, high) = corners.min(axis=0), corners.max(axis=0)
    moved = [abs(out) for _, _, out, _, _ in rows if out is not None]
    limit = max([FEWEST_MM, *moved])
    scale = WIDTH_PX / max(right - left, 1e-9)
    height = scale * (high - low)
    shapes = []
    for (stone, status, out, detected, _), ring in zip(rows, rings):
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in (ring - [left, high]) * [scale, -scale])
        said = status if out is None else f"{out:+.2f} mm out, detection limit {detected:.2f} mm"
        colour = GREY if out is None else _colour(out / limit)
        shapes.append(f'<polygon points="{points}" fill="{colour}"><title>stone {stone}: {said}</title></polygon>')
    words = f"blue {-limit:.1f} mm into the wall, red {limit:.1f} mm out of it, grey not measured"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-2 -2 {WIDTH_PX + 4} {height + 24:.0f}" width="{WIDTH_PX}" role="img" '
        f'aria-label="Map of the motion out of the wall: {words}"><g stroke="#444" stroke-width="0.5">{"".join(shapes)}</g>'
        f'<text y="{height + 16:.0f}" font-size="13" font-family="sans-serif" fill="#777">{words}</text></svg>'
    )


def _ring(blob: bytes) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Corners (n, 2) of the outline of a polygon in two dimensions."""
    start = 8 + BYTES_OF_ENVELOPE[(blob[3] >> 1) & 7] + 9
    (count,) = struct.unpack_from("<I", blob, start)
    return np.frombuffer(blob, "<f8", 2 * count, start + 4).reshape(count, 2)


def _colour(share: float) -> str:
    """White at 0, red at 1, blue at -1."""
    end = RED if share > 0 else BLUE
    return "#" + "".join(f"{round(247 + (channel - 247) * abs(share)):02x}" for channel in end)
