"""What a person does with the plugin, done inside QGIS by python/tests/test_qgis.py.

STONEWISE_DRIVE names a JSON file: `results`, `program` and `out`, a folder for pictures and for `seen.json`, what was seen.
"""

import json
import os
import traceback
from pathlib import Path

import qgis.utils
from qgis.core import QgsPointXY, QgsProject, QgsSettings
from qgis.PyQt.QtCore import QTimer
from qgis.PyQt.QtWidgets import QApplication

TASK = json.loads(Path(os.environ["STONEWISE_DRIVE"]).read_text())
OUT = Path(TASK["out"])


def picture(name: str):
    canvas = qgis.utils.iface.mapCanvas()
    for _ in range(5):
        QApplication.processEvents()
        canvas.waitWhileRendering()
    qgis.utils.iface.mainWindow().grab().save(str(OUT / f"{name}.png"))
    return canvas


def stone(layer, number: int):
    return next(f for f in layer.getFeatures() if f["stone_id"] == number)


def drive() -> dict:
    plugin, iface = qgis.utils.plugins["stonewise"], qgis.utils.iface
    iface.mainWindow().resize(1400, 900)
    picture("empty")  # Waits until the window has its size.
    layers = plugin.open(TASK["results"])
    canvas = picture("opened")
    iface.messageBar().clearWidgets()
    image = picture("map").grab().toImage()
    shown, wall = canvas.extent(), layers["stones_facade"].extent()
    seen = {"whole": shown.contains(wall), "off_centre": shown.center().distance(wall.center())}
    seen |= {"layers": sorted(layers), "colours": {}, "styles": layers["stones_facade"].styleManager().styles()}
    to_pixels = canvas.getCoordinateTransform()
    for feature in layers["stones_facade"].getFeatures():
        # Above the middle, where number and arrow stand.
        box = feature.geometry().boundingBox()
        at = to_pixels.transform(QgsPointXY(box.center().x(), box.center().y() + 0.3 * box.height()))
        seen["colours"][feature["stone_id"]] = image.pixelColor(round(at.x()), round(at.y())).getRgb()[:3]

    plugin.number.setText(str(TASK["stone"]))
    plugin.number.returnPressed.emit()
    centre = picture("stone").extent().center()
    seen |= {
        "centre": [centre.x(), centre.y()],
        "selected": [f["stone_id"] for f in layers["stones_facade"].selectedFeatures()],
        "said": iface.messageBar().currentItem().text(),
    }

    layer = plugin.correct()
    deleted, (first, second) = TASK["delete"], TASK["merge"]
    layer.deleteFeature(stone(layer, deleted).id())
    kept, gone = stone(layer, first), stone(layer, second)
    layer.changeGeometry(kept.id(), kept.geometry().combine(gone.geometry()).convexHull())
    layer.deleteFeature(gone.id())
    box = stone(layer, TASK["split"]).geometry().boundingBox()
    x = box.center().x()
    layer.selectByExpression(f'"stone_id" = {TASK["split"]}')
    seen["split"] = int(layer.splitFeatures([QgsPointXY(x, box.yMinimum() - 0.01), QgsPointXY(x, box.yMaximum() + 0.01)]))
    picture("corrected")
    QgsSettings().setValue("stonewise/program", TASK["program"])
    seen["command"] = plugin.send("A. Keller", "seen on site", OUT / "edits.json")
    again = plugin.correct()
    seen["again"] = again.id() == layer.id() and len(QgsProject.instance().mapLayers()) == len(layers) + 1
    return seen


def go():
    try:
        seen = drive()
    except BaseException:
        seen = {"error": traceback.format_exc()}
    (OUT / "seen.json").write_text(json.dumps(seen))
    os._exit(0)


QTimer.singleShot(1000, go)
