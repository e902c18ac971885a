"""Which recordings there are, of which rig: from patterns, lists and tables."""

from __future__ import annotations

import glob
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import muslip

from .. import _native
from .._errors import MuslipError
from . import _storage
from ._process import Group, Maps, Recording, Rigs

LABELS = ("rig", "tyre", "track", "day")
"""Columns of a table that recordings are grouped by."""

Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]


def _text(value: Any) -> str | None:
    """A cell as text: days as 2026-03-01, what is missing as ``None``."""
    if value is None or value != value:
        return None
    if hasattr(value, "isoformat"):
        return str(value.isoformat())[:10]
    return str(value)


def _columns(table: Any) -> dict[str, list[Any]]:
    """The columns of a table of pandas, polars, pyarrow, Spark or of a mapping, as lists."""
    if hasattr(table, "toPandas"):  # Spark
        table = table.toPandas()
    elif hasattr(table, "to_pylist"):  # pyarrow
        return {name: table[name].to_pylist() for name in table.column_names}
    elif hasattr(table, "get_columns"):  # polars
        return {column.name: column.to_list() for column in table.get_columns()}
    return {str(name): list(table[name]) for name in table}


def recordings_of(given: Any) -> list[Recording]:
    """The recordings of a pattern, a list of paths and patterns, or a table with a column ``path``, each once.

    Raises
    ------
    MuslipError
        A pattern that nothing fits, a table without paths, a recording that is there twice with different labels.
    """
    if isinstance(given, (str, os.PathLike)):
        given = [given]
    if isinstance(given, (list, tuple)):
        every = [Recording(path) for one in given for path in _expanded(os.fspath(one))]
    else:
        columns = _columns(given)
        if "path" not in columns:
            raise MuslipError(f"error: the table has no column path, but {', '.join(columns) or 'none'}", "table", 1, 1, "path")
        names = ["path", *(name for name in (*LABELS, "map") if name in columns)]
        rows = zip(*(columns[name] for name in names), strict=True)
        every = [Recording(**dict(zip(names, (_text(cell) for cell in row), strict=True))) for row in rows]  # type: ignore[arg-type]
    by_path: dict[str, Recording] = {}
    for one in every:
        if one.path is None:
            raise MuslipError("error: the table has a row without a path", "table", 1, 1, "path")
        if by_path.setdefault(one.path, one) != one:
            raise MuslipError(f"{one.path}:1:1: given twice, as of different rigs, tyres, tracks, days or maps", one.path, 1, 1)
    return list(by_path.values())


def _expanded(path: str) -> list[str]:
    is_file = not _storage.is_remote(path) and os.path.isfile(path)
    is_folder = not _storage.is_remote(path) and os.path.isdir(path)
    if is_file or not (is_folder or glob.has_magic(path)):
        return [path]
    found = _storage.found(path)
    if not found:
        raise MuslipError(f"{path}:1:1: no file fits", path, 1, 1)
    return found


def groups_of(recordings: Iterable[Recording], by: Sequence[str], most: int) -> list[Group]:
    """Recordings with the same labels together, at most so many of each, evenly chosen in the order of their days and paths."""
    unknown = [name for name in by if name not in LABELS]
    if unknown or not by:
        raise MuslipError(f"error: by = {', '.join(unknown) or 'nothing'}: must be of {', '.join(LABELS)}")
    together: dict[tuple[str, ...], list[Recording]] = {}
    for one in recordings:
        labels = tuple(getattr(one, name) for name in by)
        if None in labels:
            raise MuslipError(f"{one.path}:1:1: the table does not say its {by[labels.index(None)]}", one.path, 1, 1)
        together.setdefault(labels, []).append(one)
    groups = []
    for labels, members in sorted(together.items()):
        members.sort(key=lambda one: (one.day or "", one.path))
        if len(members) > most:
            members = [members[round(index * (len(members) - 1) / max(1, most - 1))] for index in range(most)]
        groups.append(Group(", ".join(labels), tuple(members)))
    return groups


def _is_keyed(given: Any, table: str) -> bool:
    """Whether a mapping has one for each key, and is not one of them itself."""
    return isinstance(given, Mapping) and not isinstance(given.get(table), Mapping)


def rigs_of(given: Any, keys: Iterable[str | None]) -> Rigs:
    """The rig of every key, or the error that it is.

    Raises
    ------
    MuslipError
        The one rig that all have cannot be used.
    """

    def one(rig: Any) -> muslip.Rig:
        return rig if isinstance(rig, muslip.Rig) else muslip.Rig._of(muslip._rig(rig))

    if given is not None and not _is_keyed(given, "wheel"):
        rig = one(given)
        return dict.fromkeys(keys, rig)
    return {key: _found(given, key, one, "rig") for key in keys}


def maps_of(given: Any, keys: Iterable[str | None]) -> Maps:
    """The map of every key, as :func:`rigs_of`; none where none is given."""

    def one(map: Any) -> dict[str, Any]:
        made: dict[str, Any] = dict(map) if isinstance(map, Mapping) else json.loads(_native.map_json(map))
        return made

    if given is not None and not _is_keyed(given, "channels"):
        map = one(given)
        return dict.fromkeys(keys, map)
    return {key: None if key is None else _found(given, key, one, "map") for key in keys}


def _found(given: Mapping[str, Any] | None, key: str | None, one: Any, what: str) -> Any:
    """What a key stands for: an entry of the mapping, or a file where there is no mapping."""
    try:
        if key is None:
            raise MuslipError(f"error: no {what} is given for it")
        if given is None:
            return one(key)
        if key not in given:
            raise MuslipError(f"error: no {what} {key!r} among those given")
        return one(given[key])
    except MuslipError as error:
        return error
