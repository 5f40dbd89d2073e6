"""Writes photos as cameras and other programs do. Needs pillow, piexif, tifffile, numpy. Run here: python3 generate.py

Pixels of the TIFF files, 40 x 30: red = 6 x, green = 8 y, blue = 100, of 255; 16-bit values are times 257.
"""

import numpy as np
import piexif
import tifffile
from PIL import Image

x, y = np.meshgrid(np.arange(40), np.arange(30))
rgb = np.stack([6 * x, 8 * y, np.full_like(x, 100)], axis=2).astype(np.uint8)

exif = {
    "0th": {piexif.ImageIFD.Make: "DJI", piexif.ImageIFD.Model: "FC6310", piexif.ImageIFD.DateTime: "2025:04:13 00:00:00"},
    "Exif": {
        piexif.ExifIFD.DateTimeOriginal: "2025:04:12 09:31:02",
        piexif.ExifIFD.FocalLength: (88, 10),
        piexif.ExifIFD.FocalLengthIn35mmFilm: 24,
    },
    "GPS": {
        piexif.GPSIFD.GPSLatitudeRef: "S",
        piexif.GPSIFD.GPSLatitude: [(51, 1), (5, 1), (167400, 10000)],
        piexif.GPSIFD.GPSLongitudeRef: "E",
        piexif.GPSIFD.GPSLongitude: [(7, 1), (44, 1), (98000, 10000)],
        piexif.GPSIFD.GPSAltitudeRef: 1,
        piexif.GPSIFD.GPSAltitude: (12345, 1000),
    },
}
Image.fromarray(rgb).save("exif.jpg", quality=50, exif=piexif.dump(exif))
Image.fromarray(rgb).save("rgb8.tif", compression="tiff_lzw")
tifffile.imwrite("rgb16.tif", rgb.astype(np.uint16) * 257, photometric="rgb", byteorder=">", software=False,
                 datetime="2025:04:12 09:31:02", metadata=None, extratags=[(271, 2, 0, "Phase One", True)])
