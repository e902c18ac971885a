"""One recording, or one group of them, as one row. What goes wrong is in the row."""

from __future__ import annotations

import contextlib
import hashlib
import json
import time
from dataclasses import dataclass, fields
from typing import Any, Literal

import muslip

from .. import _native
from .._errors import MuslipError
from . import _storage

Row = dict[str, Any]


@dataclass(frozen=True)
class Options:
    """What is asked of every recording."""

    range: Literal["aircraft", "automotive"] | None = None
    estimator: Literal["article", "efficient"] | None = None
    diagnose: bool = False
    timeout_s: float | None = None


@dataclass(frozen=True)
class Recording:
    """A recording and what belongs to it: keys of its rig and map, and what it is grouped by."""

    path: str
    rig: str | None = None
    map: str | None = None
    tyre: str | None = None
    track: str | None = None
    day: str | None = None

    @property
    def key(self) -> str:
        """What its row is found by."""
        return self.path

    @property
    def members(self) -> tuple[Recording, ...]:
        """The recordings of the row."""
        return (self,)

    def labels(self) -> Row:
        """What says whose row it is and where it belongs, as its columns."""
        return {"path": self.path, "rig": self.rig, "tyre": self.tyre, "track": self.track, "day": self.day}


@dataclass(frozen=True)
class Group:
    """Recordings that are diagnosed together."""

    name: str
    members: tuple[Recording, ...]

    @property
    def key(self) -> str:
        """What its row is found by."""
        return self.name

    def labels(self) -> Row:
        """What says whose row it is and how many are in it, as its columns."""
        return {"group": self.name, "recordings": len(self.members)}


Unit = Recording | Group
Rigs = dict[str | None, muslip.Rig | MuslipError]
Maps = dict[str | None, dict[str, Any] | MuslipError | None]


def error_of(error: Exception) -> Row:
    """An error as columns."""
    if isinstance(error, MuslipError):
        where = {"error_file": error.file, "error_line": error.line, "error_column": error.column, "error_channel": error.channel}
        return {"error": str(error), **where}
    return {"error": f"error: internal, please report it: {type(error).__name__}: {error}"}


def settings_of(rig: muslip.Rig | MuslipError, map: object, options: Options) -> str:
    """What else than recording and version decides the row, as a short hash."""
    said = {
        "rig": str(rig) if isinstance(rig, MuslipError) else [rig.to_toml(), rig._engine.whole],
        "map": str(map) if isinstance(map, MuslipError) else map,
        **{one.name: getattr(options, one.name) for one in fields(options)},
    }
    return hashlib.blake2b(json.dumps(said, sort_keys=True).encode(), digest_size=8).hexdigest()


def _seen(unit: Unit, stack: contextlib.ExitStack) -> tuple[list[str], str]:
    """Its recordings as files of this machine, as long as the stack lasts, and a hash of their bytes."""
    paths, whole = [], hashlib.blake2b(digest_size=16)
    for member in unit.members:
        if isinstance(unit, Group):
            whole.update(member.path.encode() + b"\0")
        try:
            paths.append(stack.enter_context(_storage.here(member.path)))
            with open(paths[-1], "rb") as stream:
                while block := stream.read(1 << 20):
                    whole.update(block)
        except OSError as error:
            is_missing = isinstance(error, FileNotFoundError)
            reason = "no such file or directory" if is_missing else (error.strerror or str(error)).lower()
            raise MuslipError(f"{member.path}:1:1: cannot be read: {reason}", member.path, 1, 1) from None
    return paths, whole.hexdigest()


def fingerprint_of(unit: Unit) -> str | None:
    """A hash of the bytes of its recordings; ``None`` where they cannot be read."""
    try:
        with contextlib.ExitStack() as stack:
            return _seen(unit, stack)[1]
    except Exception:
        return None


def _named(path: str, rig: muslip.Rig, map: Any, name: str) -> muslip.Recording:
    """A copy of a file from elsewhere, which goes by the name that it has there."""
    # The map in a rig's file is for files, which this has ceased to be.
    tables = rig.to_dict() if map is None and rig._engine.whole else {}
    map = map or {table: tables[table] for table in ("channels", "time") if table in tables} or None
    return muslip.Recording._of(_native.Columns.read(path, muslip._map(map), name))


def _mechanisms(diagnosis: muslip.Diagnosis) -> Row:
    named = [{"id": one.id, "confidence": one.evidence.confidence} for one in diagnosis.mechanisms]
    return {"diagnosis": diagnosis.verdict, "mechanisms": named}


def _estimated(source: Any, rig: muslip.Rig, map: Any, options: Options) -> Row:
    result = muslip.estimate(source, rig, map=map, range=options.range, estimator=options.estimator, trace=False)
    row = {
        "verdict": result.consistency.verdict,
        "peak_friction": result.peak_friction.value,
        "peak_friction_std": result.peak_friction.std,
        "critical_slip": result.critical_slip.value,
        "critical_slip_std": result.critical_slip.std,
        "correlation": result.correlation,
        "samples": result.samples.used,
    }
    return row | _mechanisms(muslip.diagnose([source], rig, map=map)) if options.diagnose else row


def _diagnosed(sources: list[Any], rig: muslip.Rig, map: Any) -> Row:
    diagnosis = muslip.diagnose(sources, rig, map=map)
    return {"verdict": diagnosis.verdict, "mechanisms": _mechanisms(diagnosis)["mechanisms"], "json": diagnosis.to_json()}


def computed(
    unit: Unit,
    rig: muslip.Rig | MuslipError,
    map: dict[str, Any] | MuslipError | None,
    options: Options,
    known: str | None = None,
) -> Row | None:
    """The columns of a row's result; ``None`` where its recordings are as they were when their fingerprint was ``known``."""
    start = time.perf_counter()
    row: Row = {}
    try:
        with contextlib.ExitStack() as stack:
            paths, fingerprint = _seen(unit, stack)
            if fingerprint == known:
                return None
            for given in (rig, map):
                if isinstance(given, MuslipError):
                    raise given
            assert isinstance(rig, muslip.Rig) and not isinstance(map, MuslipError)
            # Seen whole, so that whatever comes now is an answer about these very bytes.
            row["fingerprint"] = fingerprint
            names = [member.path for member in unit.members]
            sources = [path if path == name else _named(path, rig, map, name) for path, name in zip(paths, names, strict=True)]
            row |= _diagnosed(sources, rig, map) if isinstance(unit, Group) else _estimated(sources[0], rig, map, options)
    except Exception as error:
        row |= error_of(error)
    row["seconds"] = time.perf_counter() - start
    return row
