"""Makes GeoTIFF files of the geoid in geoid.gtx with GDAL, and checks that PROJ reads the heights of geoid.json from them. Needs
rasterio and pyproj. Run: python3 geoid_tiff.py

geoid_area.tif   as gdal_translate makes it: floats, one tile, deflate with predictor 3, coordinates on corners of pixels
geoid_point.tif  as PROJ's grids: integers with scale and offset, tiles, predictor 2, coordinates on nodes, a second band;
                 wider than the geoid, without heights there
geoid_strips.tif strips without compression, both bands of a node together
"""

import json
from pathlib import Path

import numpy as np
import rasterio
import rasterio.shutil
from pyproj import Transformer
from rasterio.transform import from_origin

HERE = Path(__file__).parent
NO_HEIGHT, MORE_ROWS, MORE_COLUMNS, SCALE, OFFSET = -32768, 12, 13, 0.001, 45.0

with rasterio.open(HERE / "geoid.gtx") as source:
    heights, place = source.read(1).astype(float), source.transform
rasterio.shutil.copy(
    HERE / "geoid.gtx", HERE / "geoid_area.tif", driver="GTiff", COMPRESS="DEFLATE", PREDICTOR=3, TILED="YES", BLOCKXSIZE=16,
    BLOCKYSIZE=16,
)
(HERE / "geoid_area.tif.aux.xml").unlink(missing_ok=True)

rows, columns = heights.shape
is_height = heights > -88
wide = np.full((rows + 2 * MORE_ROWS, columns + 2 * MORE_COLUMNS), NO_HEIGHT, dtype="int16")
wide[MORE_ROWS:-MORE_ROWS, MORE_COLUMNS:-MORE_COLUMNS] = np.where(is_height, np.round((heights - OFFSET) / SCALE), NO_HEIGHT)
origin = from_origin(place.c - MORE_COLUMNS * place.a, place.f - MORE_ROWS * place.e, place.a, -place.e)
common = {"driver": "GTiff", "count": 2, "crs": "EPSG:4326"}
with rasterio.open(
    HERE / "geoid_point.tif", "w", height=wide.shape[0], width=wide.shape[1], dtype="int16", nodata=NO_HEIGHT, transform=origin,
    compress="deflate", predictor=2, tiled=True, blockxsize=16, blockysize=16, interleave="band", **common,
) as file:
    file.update_tags(AREA_OR_POINT="Point", TYPE="VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL")
    file.write(wide, 1)
    file.write(np.zeros_like(wide), 2)
    file.scales, file.offsets = (SCALE, 1.0), (OFFSET, 0.0)
    file.descriptions = ("geoid_undulation", "accuracy")

with rasterio.open(
    HERE / "geoid_strips.tif", "w", height=rows, width=columns, dtype="float32", nodata=-88.8888, transform=place, blockysize=2,
    interleave="pixel", **common,
) as file:
    file.write(heights.astype("float32"), 1)
    file.write(np.ones((rows, columns), dtype="float32"), 2)

for name, tolerance in [("area", 1e-5), ("point", 6e-4), ("strips", 1e-5)]:
    grid = Transformer.from_pipeline(f"+proj=vgridshift +grids={HERE / f'geoid_{name}.tif'} +multiplier=1")
    for latitude, longitude, height in json.loads((HERE / "geoid.json").read_text())["points"]:
        x, y, z = grid.transform(np.radians(longitude), np.radians(latitude), 0.0, radians=True)
        assert abs(z - height) < tolerance, (name, latitude, longitude, z, height)
