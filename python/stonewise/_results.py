"""The results of a run, read from its folder."""

from __future__ import annotations

import functools
import html
import json
import os
import tempfile
from collections.abc import Iterable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Optional, Union

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.parquet
from numpy.typing import NDArray

from . import _map, _tables
from ._native import Error
from ._native import fixed as _native_fixed

__all__ = ["Pair", "Results", "Warning", "open"]

# Folder of all result files but those that people open.
DATA = "data"


@dataclass(frozen=True)
class Warning:  # noqa: A001
    """What went wrong without stopping the run."""

    step: str
    """The step that met it."""
    subject: str
    """The photo, camera, file, epoch or stone that it is about."""
    message: str
    """What happened, and what to do about it."""
    skipped_input: bool
    """An input of the project was left out."""
    doubt: bool
    """The results as a whole cannot be relied on."""
    code: str = ""
    """Name under which ``stonewise explain`` says more of it."""


def open(results: Union[str, os.PathLike[str]]) -> Results:  # noqa: A001
    """The results in a folder that ``stonewise run --out`` or :func:`run` wrote, here or on another machine.

    :raises Error: There are no results.

    >>> r = stonewise.open("results")                        # doctest: +SKIP
    >>> r.stones.query("loose == 1")                         # doctest: +SKIP
    """
    path = Path(results)
    if not (path / DATA / "stones.parquet").is_file():
        if (path / "stones.parquet").is_file():
            raise Error(f"these results are of an earlier version, which laid its files out otherwise: run again: {path}")
        raise Error(f"no results here (no {DATA}/stones.parquet); give the folder that `stonewise run --out` wrote: {path}")
    return Results(path)


class Pair:
    """A later epoch against the first: n stones of the first epoch and what became of them."""

    def __init__(self, results: Results, number: int) -> None:
        self._results = results
        self.number = number
        """1 for the second epoch, 2 for the third, and so on."""

    def __repr__(self) -> str:
        epochs = self._results.epochs
        names = f"{epochs[self.number]!r} against {epochs[0]!r}" if self.number < len(epochs) else str(self.number)
        return f"Pair({names}: {_counted(self.stones_arrow.num_rows, 'stone')})"

    @property
    def stones(self) -> Any:
        """One row for each stone of the first epoch: a geopandas frame with the stones' outlines where geopandas is installed, else a
        pandas frame, else the same as :attr:`stones_arrow`. Columns, units and meanings are those of ``stones.parquet``."""
        return self._with_shapes(self.stones_arrow, "stones", ["stone_id"])

    @functools.cached_property
    def stones_arrow(self) -> pa.Table:
        """``stones.parquet`` as an Arrow table; unit and meaning of the columns are in ``schema.metadata``."""
        return _read_parquet(self._file("stones", "parquet"))

    @property
    def displacement(self) -> NDArray[np.float64]:
        """(n, 3) metres, world, later epoch minus first; NaN where a stone was not measured."""
        return _tables.displacement(self.stones_arrow)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(n, 3, 3) m^2 of :attr:`displacement`; NaN where a stone was not measured. Where the datum is unknown, of the motion against the
        common rigid motion of the measured stones."""
        return _tables.covariance(self.stones_arrow)

    def budget(self, stone_id: int) -> dict[str, NDArray[np.float64]]:
        """Where the standard deviation of a stone's motion comes from: for each term its share along the wall, up and out, metres. Their
        squares add up to those of ``sd_along``, ``sd_up`` and ``sd_out``. Empty where the stone was not measured.

        :raises Error: There is no such stone.
        """
        stones = self.stones_arrow
        rows = stones.filter(pa.compute.equal(stones["stone_id"], stone_id)).to_pylist()
        if not rows:
            raise Error(f"no stone {stone_id} in {self._file('stones', 'parquet')}")
        return {t["term"]: np.array([t["sd_along"], t["sd_up"], t["sd_out"]]) for t in rows[0]["budget"]}

    @property
    def joints(self) -> Any:
        """The joints between neighbouring stones, metres: ``stone_1, stone_2, width, opening, sliding, step_out, sigma_opening,
        significant``; a geopandas frame with lines, else pandas, else Arrow. ``None`` where the run wrote no layers."""
        table = self.joints_arrow
        return None if table is None else self._with_shapes(table, "joints", ["stone_1", "stone_2"])

    @functools.cached_property
    def joints_arrow(self) -> Optional[pa.Table]:
        """The joints between neighbouring stones as an Arrow table; ``None`` where the run wrote no layers."""
        return self._layer_table("joints")

    @property
    def matches(self) -> Any:
        """What became of every stone of the first epoch when its partner was sought: ``stone_id, matched_id, outcome`` (matched, unseen,
        lost, ambiguous, area_mismatch) and its nearest candidate: ``nearest_id, distance`` (m)``, ratio, area_ratio``. pandas, else Arrow."""
        return _tables.dressed(self.matches_arrow)

    @functools.cached_property
    def matches_arrow(self) -> pa.Table:
        """What became of every stone of the first epoch when its partner was sought, as an Arrow table."""
        report = _read_json(self._file("matches", "json"))
        qualities = {q["first"]: q for q in report["qualities"]}
        rows = []
        for stone, outcome in report["outcomes"]:
            matched = outcome.get("Matched")
            quality = qualities.get(stone, {})
            rows.append(
                {
                    "stone_id": stone,
                    "matched_id": matched["second"] if matched else None,
                    "outcome": "matched" if matched else outcome["Unmatched"],
                    "nearest_id": quality.get("nearest"),
                    "distance": quality.get("distance_m"),
                    "ratio": quality.get("ratio"),
                    "area_ratio": quality.get("area_ratio"),
                }
            )
        schema = pa.schema(
            [
                ("stone_id", pa.uint32()),
                ("matched_id", pa.uint32()),
                ("outcome", pa.string()),
                ("nearest_id", pa.uint32()),
                ("distance", pa.float64()),
                ("ratio", pa.float64()),
                ("area_ratio", pa.float64()),
            ]
        )
        return pa.Table.from_pylist(rows, schema=schema)

    @property
    def registration(self) -> dict[str, Any]:
        """``registration.json``: convergence, noise, sources and their errors, and ``datum``."""
        found: dict[str, Any] = _read_json(self._file("registration", "json"))
        return found

    @property
    def evaluation(self) -> Optional[dict[str, Any]]:
        """``evaluation.json``, where the project prescribes a motion, else ``None``."""
        return _read_json_if_there(self._file("evaluation", "json"))

    def _file(self, stem: str, extension: str) -> Path:
        return self._results.path / DATA / f"{self._numbered(stem)}.{extension}"

    def _numbered(self, stem: str) -> str:
        return stem if self.number == 1 else f"{stem}_{self.number}"

    def _layer_table(self, stem: str) -> Optional[pa.Table]:
        """The attributes of a layer of ``stones.gpkg``."""
        layers = self._results.path / "stones.gpkg"
        if not layers.is_file():
            return None
        name = self._numbered(stem)
        with closing(_map.opened(layers)) as base:
            columns = [(row[1], row[2]) for row in base.execute(f'PRAGMA table_info("{name}")')]
            columns = [(column, kind) for column, kind in columns if column not in ("fid", "geom")]
            if not columns:
                return None
            chosen = ", ".join(f'"{column}"' for column, _ in columns)
            rows = base.execute(f'SELECT {chosen} FROM "{name}" ORDER BY fid').fetchall()
        arrays = {}
        for (column, kind), values in zip(columns, zip(*rows) if rows else [()] * len(columns)):
            kinds = {"INTEGER": pa.int64(), "DOUBLE": pa.float64(), "TEXT": pa.string()}
            arrays[column] = pa.array(values, type=kinds.get(kind))
        return pa.table(arrays)

    def _with_shapes(self, table: pa.Table, stem: str, key: list[str]) -> Any:
        """The table with the geometry of a layer, where geopandas is installed."""
        frame = _tables.dressed(table)
        layers = self._results.path / "stones.gpkg"
        try:
            import geopandas
        except ImportError:
            return frame
        if not layers.is_file():
            return frame
        shapes = geopandas.read_file(layers, layer=self._numbered(stem), columns=key)
        places = {tuple(int(v) for v in row[:-1]): row[-1] for row in shapes[[*key, "geometry"]].itertuples(index=False)}
        keys = zip(*(table.column(name).to_pylist() for name in key))
        crs = self._results.record.get("crs")
        known = (f"EPSG:{crs['epsg']}" if crs["epsg"] else crs["wkt"]) if crs else None
        return geopandas.GeoDataFrame(frame, geometry=[places.get(k) for k in keys], crs=known)


class Results(Pair):
    """The results of a run: those of the second epoch, :attr:`pairs` for all later epochs, and what concerns the whole run."""

    def __init__(self, path: Path) -> None:
        super().__init__(self, 1)
        self.path = path
        """The folder."""

    def __repr__(self) -> str:
        stones = _counted(self.stones_arrow.num_rows, "stone")
        return f"Results({str(self.path)!r}: {stones}, {_counted(len(self.pairs) + 1, 'epoch')})"

    def _repr_html_(self) -> str:
        """The verdict's sentence and a map of the motion out of the wall, for Jupyter."""
        sentence = (self.verdict or {}).get("sentence") or repr(self)
        return f"<div><p>{html.escape(sentence)}</p>{_map.svg(self.path / 'stones.gpkg')}</div>"

    @functools.cached_property
    def record(self) -> dict[str, Any]:
        """``run.json``: versions, inputs, times, memory. Empty where the run did not go so far."""
        return _read_json_if_there(self.path / "run.json") or {}

    @property
    def epochs(self) -> list[str]:
        """Names of the epochs, in time order."""
        return [epoch["name"] for epoch in self.record.get("epochs", [])]

    @property
    def pairs(self) -> list[Pair]:
        """Each later epoch against the first."""
        found: list[Pair] = [self]
        while (self.path / DATA / f"stones_{len(found) + 1}.parquet").is_file():
            found.append(Pair(self, len(found) + 1))
        return found

    @property
    def series(self) -> Any:
        """The rows of all later epochs, each with the name of its epoch in the column ``epoch``: pandas, else Arrow."""
        return _tables.dressed(self.series_arrow)

    @functools.cached_property
    def series_arrow(self) -> pa.Table:
        """The rows of all later epochs as an Arrow table."""
        path = self.path / DATA / "series.parquet"
        if path.is_file():
            return _read_parquet(path)
        names = self.epochs[1:2] or [""]
        epoch = pa.array(names * self.stones_arrow.num_rows, type=pa.string())
        return self.stones_arrow.add_column(0, "epoch", epoch)

    @property
    def warnings(self) -> list[Warning]:
        """What went wrong without stopping the run."""
        return [
            Warning(w["step"], w["subject"], w["message"], w["skipped_input"], w.get("doubt", False), w.get("code", ""))
            for w in self.record.get("warnings", [])
        ]

    @property
    def parameters(self) -> dict[str, Any]:
        """Every parameter as it was used, in the tables of the project file."""
        found: dict[str, Any] = self.record.get("parameters", {})
        return found

    @property
    def datum(self) -> dict[str, str]:
        """What is known about the registration of each later epoch: ``stable``, ``stated``, ``sources`` or ``unknown``."""
        found: dict[str, str] = self.record.get("datum", {})
        return found

    @property
    def verdict(self) -> Optional[dict[str, Any]]:
        """``verdict.json``, where the run wrote one, else ``None``."""
        return _read_json_if_there(self.path / "verdict.json")

    def fixed(self, stones: Union[str, Iterable[int]]) -> Any:
        """Motions and covariances of all later epochs with these stones, or the zone of this name, as the datum, without a new run: the
        table of ``stonewise datum``, pandas, else Arrow.

        :raises Error: A stone or zone is not in the results, or fewer than three of the stones were measured.

        >>> r.fixed([12, 13, 14, 57])                        # doctest: +SKIP
        """
        chosen = stones if isinstance(stones, str) else ",".join(str(int(stone)) for stone in stones)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "fixed.parquet"
            _native_fixed(self.path, chosen, path)
            return _tables.dressed(_read_parquet(path))

    @property
    def report(self) -> Path:
        """The report: one file for a browser."""
        return self.path / "report.html"


def _counted(n: int, noun: str) -> str:
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def _read_parquet(path: Path) -> pa.Table:
    try:
        with pa.parquet.ParquetFile(path) as file:
            return file.read()
    except (OSError, pa.ArrowException) as error:
        raise Error(f"{error}; make it anew with `stonewise run`: {path}") from error


def _read_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise Error(f"{error}; make it anew with `stonewise run`: {path}") from error


def _read_json_if_there(path: Path) -> Optional[dict[str, Any]]:
    if not path.is_file():
        return None
    found: dict[str, Any] = _read_json(path)
    return found

