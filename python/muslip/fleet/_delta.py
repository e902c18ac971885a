"""The data set as a Delta table: for who reads tables by their versions."""

from __future__ import annotations

import json
import os

import pyarrow

from .._errors import MuslipError
from ._results import ABOUT, GROUPS, RECORDINGS, Results, key_of
from ._storage import Folder


def to_delta(
    results: str | os.PathLike[str], table: str | os.PathLike[str], storage_options: dict[str, str] | None = None
) -> int:
    """Bring a Delta table to what a data set of :func:`run` or :func:`diagnose` says, in one transaction.

    A reader of the table sees the rows before or the rows after, never some of both. Where they are the same, nothing is written.
    By the library deltalake (``pip install "muslip[delta]"``).

    Parameters
    ----------
    results : path
        The ``out`` of :func:`run` or :func:`diagnose`.
    table : path
        Folder of the table, on this machine or a storage that deltalake knows; made where there is none.
    storage_options : dict, optional
        For that storage, as deltalake takes them.

    Returns
    -------
    int
        The version of the table.

    Raises
    ------
    MuslipError
        There is no data set, or the table is of something else.
    """
    from deltalake import DeltaTable, write_deltalake

    path, target = os.fspath(results), os.fspath(table)
    folder = Folder(path)
    about = folder.read(ABOUT)
    if about is None:
        raise MuslipError(f"{path}:1:1: is not a data set of a fleet", path, 1, 1)
    schema = next(one for one in (RECORDINGS, GROUPS) if key_of(one) == json.loads(about)["rows"])
    key = key_of(schema)
    rows = Results(folder, schema, 1).table().sort_by(key)
    if not DeltaTable.is_deltatable(target, storage_options):
        write_deltalake(target, rows, storage_options=storage_options)
        return DeltaTable(target, storage_options=storage_options).version()
    there = DeltaTable(target, storage_options=storage_options)
    names = [field.name for field in there.schema().fields]
    if key not in names or not {"fingerprint", "version", "settings", "error"} <= set(names):
        raise MuslipError(f"{target}:1:1: is a table of something else: it has no rows a {key}", target, 1, 1)
    if names == schema.names and pyarrow.table(there.to_pyarrow_table()).cast(schema).sort_by(key).equals(rows):
        return there.version()
    write_deltalake(target, rows, mode="overwrite", schema_mode="overwrite", storage_options=storage_options)
    return DeltaTable(target, storage_options=storage_options).version()
