"""The plugin for QGIS, installed from its zip and used in a real window. Needs Debian's qgis and xvfb.

STONEWISE_RESULTS names other results than those of the small survey, STONEWISE_PICTURES a folder that keeps the pictures.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

QGIS = Path(__file__).parents[2] / "integrations" / "qgis"


@pytest.fixture(scope="module")
def folder(request, tmp_path_factory):
    for program in ("qgis", "xvfb-run"):
        if not shutil.which(program):
            pytest.skip(f"{program} is not installed")
    given = os.environ.get("STONEWISE_RESULTS")
    made = Path(given) if given else Path(request.getfixturevalue("results").report).parents[1]
    return shutil.copytree(made, tmp_path_factory.mktemp("qgis") / "results")


def test_open_go_to_a_stone_and_send_edits(folder, tmp_path):
    rows = {int(row["stone_id"]): row for row in csv.DictReader(open(folder / "stones.csv"))}
    measured = sorted((float(row["d_out"]), number) for number, row in rows.items() if row["d_out"])
    # Neighbours to merge: the two stones that lie closest to each other.
    place = {number: complex(float(row["along_m"]), float(row["up_m"])) for number, row in rows.items()}
    pairs = sorted((abs(place[a] - place[b]), a, b) for a in place for b in place if a < b)
    merge = list(pairs[0][1:])
    split = max((n for n in rows if n not in merge), key=lambda n: float(rows[n]["area_m2"]))
    delete = max((n for n in rows if n != split), key=lambda n: abs(place[n] - place[merge[0]]))
    task = {"results": str(folder), "out": str(tmp_path), "stone": split, "merge": merge, "split": split, "delete": delete}
    program = os.environ.get("STONEWISE") or Path(sys.executable).with_name("stonewise")
    (tmp_path / "task.json").write_text(json.dumps(task | {"program": str(program)}))
    package = (folder / "stones.gpkg").read_bytes()

    archive = subprocess.run([sys.executable, QGIS / "pack.py", tmp_path], check=True, capture_output=True, text=True).stdout.strip()
    profile = tmp_path / "profiles" / "default"
    zipfile.ZipFile(archive).extractall(profile / "python" / "plugins")
    (profile / "QGIS").mkdir()
    (profile / "QGIS" / "QGIS3.ini").write_text("[PythonPlugins]\nstonewise=true\n")
    # QGIS's Python is Debian's, not that of this test.
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL_ENV"))}
    command = ["xvfb-run", "-a", "-s", "-screen 0 1600x1000x24", "qgis", "--nologo", "--noversioncheck"]
    command += ["--profiles-path", str(tmp_path), "--code", str(QGIS / "drive.py")]
    done = subprocess.run(
        command,
        env=environment | {"STONEWISE_DRIVE": str(tmp_path / "task.json")},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert (tmp_path / "seen.json").exists(), done.stdout + done.stderr
    seen = json.loads((tmp_path / "seen.json").read_text())
    if pictures := os.environ.get("STONEWISE_PICTURES"):
        for picture in tmp_path.glob("*.png"):
            shutil.copy(picture, pictures)
    assert "error" not in seen, seen["error"]

    assert {"stones", "stones_facade", "displacements_facade", "joints_facade"} <= set(seen["layers"])
    assert seen["whole"] and seen["off_centre"] < 0.01
    assert {"Out of the wall", "Along the wall", "Up the face", "Detection limit"} <= set(seen["styles"])
    # Red out of the wall, blue into it: the stone that came out most is the redder one, if they differ by a centimetre.
    warmth = [seen["colours"][str(number)][0] - seen["colours"][str(number)][2] for _, number in (measured[0], measured[-1])]
    assert measured[-1][0] - measured[0][0] < 0.01 or warmth[0] + 20 < warmth[1]
    assert seen["selected"] == [split]
    assert abs(complex(*seen["centre"]) - place[split]) < 0.1
    assert f"stone {split}: " in seen["said"]

    assert seen["split"] == 0, "QGIS did not split"
    edits = json.loads((tmp_path / "edits.json").read_text())["edits"]
    assert sorted(edit["do"] for edit in edits) == ["delete", "merge", "split"]
    by_kind = {edit["do"]: edit for edit in edits}
    assert all((edit["who"], edit["why"]) == ("A. Keller", "seen on site") for edit in edits)
    assert abs(complex(*by_kind["delete"]["at"][0]) - place[delete]) < 1e-3
    assert {min(place, key=lambda n: abs(place[n] - complex(*at))) for at in by_kind["merge"]["at"]} == set(merge)
    assert seen["again"], "Correct stones must go on with the same copy"
    assert (folder / "stones.gpkg").read_bytes() == package, "QGIS changed the results"
