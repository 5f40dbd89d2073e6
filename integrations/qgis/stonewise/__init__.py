"""Results of stonewise in QGIS: open them, go to a stone, send corrections back."""

from __future__ import annotations

import json
import os
import re
import shutil
import sqlite3
import subprocess
from pathlib import Path

from qgis.core import (
    Qgis,
    QgsCoordinateReferenceSystem,
    QgsEditFormConfig,
    QgsMapLayerStyle,
    QgsPalLayerSettings,
    QgsProject,
    QgsSettings,
    QgsVectorLayer,
    QgsVectorLayerSimpleLabeling,
)
from qgis.PyQt.QtCore import QTimer
from qgis.PyQt.QtWidgets import QFileDialog, QInputDialog, QLabel, QLineEdit, QMessageBox

# Kinds of layers, the topmost first, and whether they are shown at once.
KINDS = {"displacements": True, "zones": True, "joints": False, "stones": True}
# A layer's kind, whether it is unrolled, and the number of the pair of epochs.
NAME = re.compile(rf"({'|'.join(KINDS)})(_facade)?(?:_(\d+))?")
EDITED, EDITED_LAYER = "edited.gpkg", "stones_facade"
# Custom property of our layers: the folder of results that they show.
FOLDER = "stonewise/folder"
LEVELS = {"fine": Qgis.MessageLevel.Success, "attention": Qgis.MessageLevel.Warning, "alarm": Qgis.MessageLevel.Critical}


class Failure(Exception):
    """What a user is told in place of a result."""


def classFactory(iface) -> Plugin:
    return Plugin(iface)


class Plugin:
    """The toolbar and menu of stonewise. The methods without dialogs do the work."""

    def __init__(self, iface):
        self.iface = iface
        self.actions = []

    def initGui(self):
        self.toolbar = self.iface.addToolBar("stonewise")
        self.toolbar.setObjectName("stonewise")
        for text, tip, ask in (
            ("Open results…", "Open a folder of results with its styles", self.ask_open),
            ("Correct stones", "Edit a copy of the stones", self.ask_correct),
            ("Send edits…", "Turn corrected stones into a file of edits", self.ask_send),
        ):
            action = self.toolbar.addAction(text)
            action.setToolTip(tip)
            action.triggered.connect(lambda _=False, ask=ask: self.attempt(ask))
            self.iface.addPluginToMenu("stonewise", action)
            self.actions.append(action)
        self.number = QLineEdit()
        self.number.setPlaceholderText("number")
        self.number.setMaximumWidth(80)
        self.number.returnPressed.connect(lambda: self.attempt(lambda: self.go_to(self.number.text())))
        self.toolbar.addWidget(QLabel(" Stone "))
        self.toolbar.addWidget(self.number)

    def unload(self):
        for action in self.actions:
            self.iface.removePluginMenu("stonewise", action)
        self.toolbar.deleteLater()

    def attempt(self, work):
        try:
            work()
        except (Failure, OSError, sqlite3.Error) as error:
            self.tell(str(error), Qgis.MessageLevel.Warning)

    def tell(self, text: str, level=Qgis.MessageLevel.Info):
        self.iface.messageBar().pushMessage("stonewise", text, level, 0)

    # Dialogs

    def ask_open(self):
        last = QgsSettings().value("stonewise/last", "")
        folder = QFileDialog.getExistingDirectory(self.iface.mainWindow(), "Folder of results", last)
        if folder:
            QgsSettings().setValue("stonewise/last", folder)
            self.open(folder)

    def ask_correct(self):
        layer = self.correct()
        self.tell(f"{layer.source().split('|')[0]}: delete, merge, split, reshape or draw stones, then send the edits")

    def ask_send(self):
        window, settings = self.iface.mainWindow(), QgsSettings()
        layer = self.edited()
        folder = Path(layer.customProperty(FOLDER))
        self.program(ask=True)
        who, go = QInputDialog.getText(window, "Send edits", "Who decided:", text=settings.value("stonewise/who", ""))
        why, go = QInputDialog.getText(window, "Send edits", "Why:") if go and who else ("", False)
        if not (go and why):
            return
        settings.setValue("stonewise/who", who)
        start = settings.value(f"stonewise/edits/{folder}", str(folder.parent / "edits.json"))
        out, _ = QFileDialog.getSaveFileName(
            window, "File of edits", start, "Edits (*.json)", options=QFileDialog.Option.DontConfirmOverwrite
        )
        if not out:
            return
        append = False
        if os.path.exists(out):
            yes, no, cancel = (getattr(QMessageBox.StandardButton, name) for name in ("Yes", "No", "Cancel"))
            question = (
                f"{out} exists. Put the new edits after those that it has?\n\n"
                "Yes: these results were made with the edits of that file.\n"
                "No: replace the file; all that differs from the results becomes an edit again."
            )
            answer = QMessageBox.question(window, "Send edits", question, yes | no | cancel)
            if answer == cancel:
                return
            append = answer == yes
        said = self.send(who, why, out, append)
        settings.setValue(f"stonewise/edits/{folder}", out)
        name = Path(out).name
        QMessageBox.information(window, "Send edits", f'{said}\n\nIn the project file:\n\n[edits]\nfile = "{name}"\n\nThen run it again.')

    # What works

    def open(self, folder: str | Path) -> dict[str, QgsVectorLayer]:
        """Opens the layers of a folder of results, in a group for the unrolled wall and one for the world."""
        folder = Path(folder).resolve()
        package = folder / "stones.gpkg"
        if not package.is_file():
            raise Failure(f"{folder} has no stones.gpkg: choose the folder that stonewise run --out wrote")
        if not (folder / "data").is_dir():
            raise Failure(f"{folder} holds results of an earlier version: run again")
        titles, styles = contents(package)
        found = [(name, match) for name in titles for match in [NAME.fullmatch(name)] if match]
        newest = max(int(match[3] or 1) for _, match in found)
        # Newest epoch first, arrows above stones.
        found.sort(key=lambda f: (-int(f[1][3] or 1), list(KINDS).index(f[1][1])))
        empty = not QgsProject.instance().mapLayers()
        root = QgsProject.instance().layerTreeRoot()
        group = root.insertGroup(0, folder.name)
        unrolled, world = group.addGroup("Wall, unrolled"), group.addGroup("World")
        world.setItemVisibilityChecked(False)
        layers = {}
        for name, match in found:
            layer = self.layer(package, name, titles[name], folder, styles.get(name, {}))
            layer.setReadOnly(True)
            node = (unrolled if match[2] else world).addLayer(layer)
            node.setItemVisibilityChecked(KINDS[match[1]] and int(match[3] or 1) == newest)
            layers[name] = layer
        for node in group.findLayers():
            node.setExpanded(False)
        stones = layers["stones_facade" if newest == 1 else f"stones_facade_{newest}"]
        if empty:
            QgsProject.instance().setCrs(layers["stones"].crs())
        self.iface.setActiveLayer(stones)
        # After QGIS has zoomed to the first layers of a project, those of the world included.
        QTimer.singleShot(0, lambda: self.show(stones, stones.extent().scaled(1.1)))
        self.tell_verdict(folder)
        return layers

    def go_to(self, number: str | int):
        """Shows and selects a stone, in the active layer of stones or in the topmost that is visible."""
        if not str(number).strip().isdigit():
            raise Failure(f"{number!r} is no number of a stone")
        nodes = [node for node in QgsProject.instance().layerTreeRoot().findLayers() if is_stones(node.layer())]
        if not nodes:
            raise Failure("no results are open")
        active = self.iface.activeLayer()
        shown = [node.layer() for node in nodes if node.isVisible()] or [nodes[0].layer()]
        layer = active if is_stones(active) else shown[0]
        layer.selectByExpression(f'"stone_id" = {int(number)}')
        stones = layer.selectedFeatures()
        if not stones:
            raise Failure(f"no stone {number} in {layer.name()}")
        box = stones[0].geometry().boundingBox()
        box.grow(2 * max(box.width(), box.height()))
        self.show(layer, box)
        self.iface.mapCanvas().flashFeatureIds(layer, [stone.id() for stone in stones])
        self.iface.messageBar().clearWidgets()
        self.tell(motion(stones[0]))

    def correct(self) -> QgsVectorLayer:
        """Opens a copy of the stones for editing: the one that was begun, if the results are still those."""
        results = [layer for layer in QgsProject.instance().mapLayers().values() if layer.customProperty(FOLDER)]
        if not results:
            raise Failure("open results first")
        active = self.iface.activeLayer()
        folder = Path((active if active in results else results[-1]).customProperty(FOLDER))
        package, copy = folder / "stones.gpkg", folder / EDITED
        opened = [layer for layer in results if Path(layer.source().split("|")[0]) == copy]
        begun = copy.exists() and copy.stat().st_mtime >= package.stat().st_mtime
        if not (opened and begun):
            if any(layer.isModified() for layer in opened):
                raise Failure(f"{copy} is of earlier results: save or discard its changes first")
            QgsProject.instance().removeMapLayers([layer.id() for layer in opened])
            if not begun:
                if copy.exists():
                    copy.replace(folder / "edited.old.gpkg")
                shutil.copyfile(package, copy)
            styles = contents(copy)[1].get(EDITED_LAYER, {})
            layer = self.layer(copy, EDITED_LAYER, "Stones to correct", folder, styles)
            form = layer.editFormConfig()
            form.setSuppress(QgsEditFormConfig.FeatureFormSuppress.SuppressOn)
            layer.setEditFormConfig(form)
            group = next((g for g in QgsProject.instance().layerTreeRoot().findGroups() if g.name() == folder.name), None)
            (group or QgsProject.instance().layerTreeRoot()).insertLayer(0, layer)
            opened = [layer]
        opened[0].startEditing()
        self.iface.setActiveLayer(opened[0])
        return opened[0]

    def send(self, who: str, why: str, out: str | Path, append: bool = False) -> str:
        """Saves the corrected stones and writes what differs from the results as edits; what the command said."""
        layer = self.edited()
        if layer.isModified() and not layer.commitChanges(False):
            raise Failure("; ".join(layer.commitErrors()))
        copy, folder = layer.source().split("|")[0], layer.customProperty(FOLDER)
        words = [self.program(), "edits", "import", copy, "--results", folder, "--who", who, "--why", why, "--out", str(out)]
        window = getattr(subprocess, "CREATE_NO_WINDOW", 0)
        done = subprocess.run(words + ["--append"] * append, capture_output=True, text=True, encoding="utf-8", creationflags=window)
        if done.returncode:
            raise Failure(done.stderr.strip() or f"stonewise ended with exit code {done.returncode}")
        return (done.stdout + done.stderr).strip()

    # Helpers

    def layer(self, package: Path, name: str, title: str, folder: Path, styles: dict[str, str]) -> QgsVectorLayer:
        layer = QgsVectorLayer(f"{package}|layername={name}", title, "ogr")
        if not layer.isValid():
            raise Failure(f"{package}: QGIS cannot read the layer {name}")
        if not layer.crs().authid():
            layer.setCrs(QgsCoordinateReferenceSystem())
        layer.setCustomProperty(FOLDER, str(folder))
        if is_stones(layer) and package.name != EDITED:
            label = QgsPalLayerSettings()
            label.fieldName, label.fitInPolygonOnly = "stone_id", True
            layer.setLabeling(QgsVectorLayerSimpleLabeling(label))
            layer.setLabelsEnabled(True)
        for style, text in styles.items():
            layer.styleManager().addStyle(style, QgsMapLayerStyle(text))
        QgsProject.instance().addMapLayer(layer, False)
        return layer

    def show(self, layer: QgsVectorLayer, box):
        canvas = self.iface.mapCanvas()
        canvas.setExtent(canvas.mapSettings().layerExtentToOutputExtent(layer, box))
        canvas.refresh()

    def tell_verdict(self, folder: Path):
        if (folder / "UNFINISHED.txt").exists():
            self.tell(f"{folder}: a run of these results has not finished", Qgis.MessageLevel.Warning)
        try:
            verdict = json.loads((folder / "run.json").read_text(encoding="utf-8"))["verdict"]
            self.tell(verdict["sentence"], LEVELS.get(verdict["state"], Qgis.MessageLevel.Info))
        except (OSError, ValueError, KeyError, TypeError):
            pass  # Results without a verdict.

    def edited(self) -> QgsVectorLayer:
        layers = [layer for layer in QgsProject.instance().mapLayers().values() if layer.customProperty(FOLDER)]
        edited = [layer for layer in layers if Path(layer.source().split("|")[0]).name == EDITED]
        if not edited:
            raise Failure("no stones were corrected: choose Correct stones first")
        active = self.iface.activeLayer()
        return active if active in edited else edited[-1]

    def program(self, ask: bool = False) -> str:
        """The command stonewise: that of the settings, else the one on the path."""
        settings = QgsSettings()
        program = shutil.which(settings.value("stonewise/program", "") or "stonewise")
        if not program and ask:
            program, _ = QFileDialog.getOpenFileName(self.iface.mainWindow(), "Where is the program stonewise?")
            settings.setValue("stonewise/program", program)
        if not program:
            raise Failure("the program stonewise was not found")
        return program


def contents(package: Path) -> tuple[dict[str, str], dict[str, dict[str, str]]]:
    """Titles of the layers by name, and their styles by name; the default style of a layer first."""
    file = sqlite3.connect(f"{package.resolve().as_uri()}?mode=ro", uri=True)
    try:
        titles = dict(file.execute("SELECT table_name, identifier FROM gpkg_contents WHERE data_type = 'features'"))
        styles: dict[str, dict[str, str]] = {}
        for name, style, text in file.execute("SELECT f_table_name, styleName, styleQML FROM layer_styles ORDER BY useAsDefault DESC, id"):
            styles.setdefault(name, {})[style] = text
    finally:
        file.close()
    return titles, styles


def is_stones(layer) -> bool:
    return bool(layer) and bool(layer.customProperty(FOLDER)) and re.search(r"layername=stones(_|$)", layer.source()) is not None


def motion(stone) -> str:
    """The motion of a stone in a line."""
    number, status = stone["stone_id"], stone["status"]
    if status != "ok":
        return f"stone {number}: {status}"
    along, up, out, limit = (1e3 * float(stone[name]) for name in ("d_along", "d_up", "d_out", "lod95"))
    return f"stone {number}: {along:+.1f} mm along the wall, {up:+.1f} up, {out:+.1f} out; limit {limit:.1f}"
