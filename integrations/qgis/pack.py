#!/usr/bin/env python3
"""Makes the zip that QGIS installs (Plugins, Install from ZIP): python3 integrations/qgis/pack.py [FOLDER], which prints its path.

The version is that of the workspace. The same sources give the same bytes.
"""

import re
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
EARLIEST = (1980, 1, 1, 0, 0, 0)


def pack(folder: Path) -> Path:
    version = re.search(r'^\[workspace\.package\][^\[]*?^version = "(.+?)"', (ROOT / "Cargo.toml").read_text(), re.M | re.S)[1]
    files = {file.name: file.read_bytes() for file in sorted(Path(__file__).with_name("stonewise").glob("*.*"))}
    files["metadata.txt"] = files["metadata.txt"].replace(b"version=VERSION", f"version={version}".encode())
    # The plugins' site asks for one file of this name.
    files["LICENSE"] = b"\nor, at your option,\n\n".join((ROOT / name).read_bytes() for name in ("LICENSE-MIT", "LICENSE-APACHE"))
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"stonewise-qgis-{version}.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo(f"stonewise/{name}", EARLIEST)
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return path


if __name__ == "__main__":
    print(pack(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "target" / "qgis"))
