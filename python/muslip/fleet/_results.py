"""The data set of results: parts of Parquet, a row a recording or a group, each part written by one task alone."""

from __future__ import annotations

import hashlib
import json
from typing import NamedTuple, cast

import pyarrow
import pyarrow.parquet

from .._errors import MuslipError
from ._process import Row
from ._storage import Folder

_TEXT, _NUMBER, _COUNT = pyarrow.string(), pyarrow.float64(), pyarrow.int64()
_MECHANISMS = pyarrow.list_(pyarrow.struct([("id", _TEXT), ("confidence", _NUMBER)]))
_MADE_OF = [("fingerprint", _TEXT), ("version", _TEXT), ("settings", _TEXT)]
_ENDED = [
    ("error", _TEXT), ("error_file", _TEXT), ("error_line", _COUNT), ("error_column", _COUNT), ("error_channel", _TEXT),
    ("seconds", _NUMBER),
]  # fmt: skip

RECORDINGS = pyarrow.schema([
    ("path", _TEXT), *_MADE_OF, ("verdict", _TEXT), ("peak_friction", _NUMBER), ("peak_friction_std", _NUMBER),
    ("critical_slip", _NUMBER), ("critical_slip_std", _NUMBER), ("correlation", _NUMBER), ("samples", _COUNT),
    ("mechanisms", _MECHANISMS), *_ENDED, ("diagnosis", _TEXT), ("rig", _TEXT), ("tyre", _TEXT), ("track", _TEXT), ("day", _TEXT),
])  # fmt: skip
"""Columns of the rows of recordings."""

GROUPS = pyarrow.schema([
    ("group", _TEXT), ("recordings", _COUNT), *_MADE_OF, ("verdict", _TEXT), ("mechanisms", _MECHANISMS), ("json", _TEXT),
    *_ENDED,
])  # fmt: skip
"""Columns of the rows of groups."""

ABOUT = "_fleet.json"
"""What the data set is, beside its parts."""

_RECORDINGS_A_PART = 256
_FEWEST_PARTS = 256


def key_of(schema: pyarrow.Schema) -> str:
    """The column that says whose row it is."""
    return cast(str, schema.names[0])


def full(row: Row, schema: pyarrow.Schema) -> Row:
    """The row with every column of its data set."""
    return {name: row.get(name) for name in schema.names}


def read(content: bytes, columns: list[str] | None = None) -> pyarrow.Table:
    """Parquet as a table, on this thread alone: one of Arrow's own that is still at it when Python ends aborts the process."""
    return pyarrow.parquet.ParquetFile(pyarrow.BufferReader(content), pre_buffer=False).read(columns, use_threads=False)


class Results:
    """A data set, as the runs before left it.

    Whose row is in which part is a matter of its key alone: a task that runs twice writes the same part again, and no row is
    there twice.
    """

    def __init__(self, folder: Folder, schema: pyarrow.Schema, parts: int) -> None:
        self.folder, self.schema, self.parts = folder, schema, parts

    @classmethod
    def made(cls, out: str, schema: pyarrow.Schema, keys: int) -> Results:
        """The data set in a folder, begun where there is none; how many parts it has stays as it began."""
        folder = Folder(out)
        folder.make()
        kind = key_of(schema)
        about = folder.read(ABOUT)
        if about is None:
            foreign = [name for name in folder.names() if not name.startswith("_")]
            if foreign:
                raise MuslipError(f"{out}:1:1: has files that are not of a fleet, as {foreign[0]}", out, 1, 1)
            parts = max(_FEWEST_PARTS, -(-keys // _RECORDINGS_A_PART))
            folder.write(ABOUT, json.dumps({"rows": kind, "parts": parts}).encode())
            return cls(folder, schema, parts)
        said = json.loads(about)
        if said["rows"] != kind:
            raise MuslipError(f"{out}:1:1: has a row a {said['rows']}, not a {kind}", out, 1, 1)
        return cls(folder, schema, said["parts"])

    def part_of(self, key: str) -> str:
        """The file that has a key's row."""
        number = int.from_bytes(hashlib.blake2b(key.encode(), digest_size=8).digest(), "big") % self.parts
        return f"part-{number:06}.parquet"

    def rows(self, part: str) -> dict[str, Row]:
        """The rows of a part, by their keys."""
        content = self.folder.read(part)
        if content is None:
            return {}
        kind = key_of(self.schema)
        rows = read(content).to_pylist()
        return {row[kind]: row for row in rows}

    def update(self, part: str, rows: dict[str, Row]) -> None:
        """Put rows into a part and write it whole, its rows in the order of their keys.

        They go into the part as it is by now: who else is at it, a task that was thought lost, may have come further.
        """
        ordered = [row for _, row in sorted((self.rows(part) | rows).items())]
        content = pyarrow.BufferOutputStream()
        pyarrow.parquet.write_table(pyarrow.Table.from_pylist(ordered, self.schema), content)
        self.folder.write(part, content.getvalue().to_pybytes())

    def table(self, columns: list[str] | None = None) -> pyarrow.Table:
        """All rows."""
        parts = [name for name in self.folder.names() if name.startswith("part-")]
        tables = []
        for part in parts:
            content = self.folder.read(part)
            if content is not None:
                tables.append(read(content, columns))
        if not tables:
            return self.schema.empty_table().select(columns or self.schema.names)
        return pyarrow.concat_tables(tables)


class Made(NamedTuple):
    """What a row was made of, and whether that was an error."""

    fingerprint: str | None
    version: str
    settings: str
    error: str | None


def made_of(results: Results) -> dict[str, Made]:
    """What each row was made of, by its key; an error where a key has two rows."""
    kind = key_of(results.schema)
    table = results.table([kind, *Made._fields])
    keys, *made = (table[name].to_pylist() for name in (kind, *Made._fields))
    rows = {key: Made(*of) for key, *of in zip(keys, *made, strict=True)}
    if len(rows) != table.num_rows:
        raise RuntimeError(f"{table.num_rows - len(rows)} rows are there twice in {results.folder.path}")
    return rows
