"""A fleet of recordings: one row each, by a pool of processes, Apache Spark or Ray, into a data set that can be gone on with.

Examples
--------
>>> import muslip
>>> from muslip.fleet import process
>>> rig = muslip.Rig(radius_m=0.31, inertia_kg_m2=1.25, mass_kg=420.0, peak_friction=0.85, critical_slip=0.14)
>>> process("nowhere.csv", rig=rig)["error"]
'nowhere.csv:1:1: cannot be read: no such file or directory'
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from .. import Map, Progress, RigLike, _Bar
from .._errors import MuslipError
from . import _child
from ._delta import to_delta
from ._engines import ENGINES
from ._process import Maps as _Maps
from ._process import Options, Recording, Unit
from ._process import Rigs as _Rigs
from ._results import GROUPS, RECORDINGS, Made, Results, full, made_of
from ._summary import Summary, summary
from ._table import groups_of, maps_of, recordings_of, rigs_of
from ._work import Asked, Plan

__all__ = ["Counts", "Summary", "diagnose", "process", "run", "summary", "to_delta"]

Engine = Literal["pool", "spark", "ray"]
Rigs = RigLike | Mapping[str, RigLike] | None
Maps = Map | Mapping[str, Map]


@dataclass(frozen=True)
class Counts:
    """What a run did: together, every recording or group there is."""

    done: int
    """Worked out now, with a result."""
    skipped: int
    """There already, of the same input, version and settings."""
    failed: int
    """Worked out now, with an error for a result."""


def process(
    path: str | os.PathLike[str],
    rig: RigLike | None = None,
    map: Map = None,
    *,
    range: Literal["aircraft", "automotive"] | None = None,
    estimator: Literal["article", "efficient"] | None = None,
    diagnose: bool = False,
    timeout_s: float | None = None,
) -> dict[str, Any]:
    """Estimate one recording, and answer with a row of plain values whatever happens.

    Parameters
    ----------
    path : path
        The recording; ``s3://...`` and the like are read through fsspec.
    rig : Rig, path or mapping
        Its rig.
    map : path or mapping, optional
        Of its channels.
    range, estimator : str, optional
        As for :func:`muslip.estimate`.
    diagnose : bool
        Whether it is diagnosed as well, by itself.
    timeout_s : float, optional
        How long it may take. Given one, a process of its own does it, and is ended then: that is an error as others are.

    Returns
    -------
    dict
        ``error`` is ``None`` where there is a result, else its line, with ``error_file``, ``error_line``, ``error_column`` and
        ``error_channel`` as its parts. The other keys are the columns of :func:`run`.
    """
    path = os.fspath(path)
    options = Options(range, estimator, diagnose, timeout_s)
    rigs: _Rigs
    maps: _Maps
    try:
        rigs = rigs_of(rig, [None])
        maps = maps_of(map, [None])
    except MuslipError as error:
        rigs, maps = {None: error}, {None: None}
    unit = Recording(path)
    asked = Asked.of([unit], rigs, maps, options)
    return full(asked.row_of(unit, None if timeout_s is None else _child.mine(None)), RECORDINGS)


def run(
    paths_or_table: Any,
    out: str | os.PathLike[str],
    engine: Engine = "pool",
    rig: Rigs = None,
    map: Maps = None,
    resume: bool = True,
    *,
    range: Literal["aircraft", "automotive"] | None = None,
    estimator: Literal["article", "efficient"] | None = None,
    diagnose: bool = False,
    timeout_s: float | None = 600.0,
    progress: Progress = None,
    **of_engine: Any,
) -> Counts:
    """Estimate every recording of a fleet into a Parquet data set, a row each.

    Parameters
    ----------
    paths_or_table : path, list of paths, or table
        A pattern (``runs/**/*.mf4``, ``s3://bucket/*.csv``), paths and patterns, or a table of pandas, polars, pyarrow or Spark
        with the column ``path`` and, where there are such, ``rig``, ``map``, ``tyre``, ``track`` and ``day``.
    out : path
        Folder of the data set, on this machine or a storage; ``pandas.read_parquet`` reads it.
    engine : {"pool", "spark", "ray"}
        Processes on this machine, Apache Spark, or Ray.
    rig, map : Rig, path or mapping
        Of all recordings; or a mapping from what the table's column of that name says; without either, that column has the files.
    resume : bool
        Whether rows stay that are there of the same recording, the same version and the same settings.
    range, estimator, diagnose, timeout_s :
        As for :func:`process`.
    progress : callable or bool, optional
        Called with the share done; ``True`` shows a bar of tqdm.
    **of_engine :
        ``workers`` of the pool; ``session`` of Spark.

    Raises
    ------
    MuslipError
        No recording fits, the one rig of all cannot be used, or the folder holds something else.
    """
    options = Options(range, estimator, diagnose, timeout_s)
    return _run(recordings_of(paths_or_table), out, RECORDINGS, engine, rig, map, resume, options, progress, of_engine)


def diagnose(
    paths_or_table: Any,
    out: str | os.PathLike[str],
    by: str | Sequence[str] = "rig",
    engine: Engine = "pool",
    rig: Rigs = None,
    map: Maps = None,
    resume: bool = True,
    *,
    most: int = 12,
    timeout_s: float | None = 3600.0,
    progress: Progress = None,
    **of_engine: Any,
) -> Counts:
    """Diagnose the recordings of every rig, tyre, track or day together, a row each, with the whole JSON in it.

    Parameters
    ----------
    paths_or_table, out, engine, rig, map, resume, timeout_s, progress, **of_engine :
        As for :func:`run`.
    by : str or sequence of str
        Columns of the table that are the same within a group: ``rig``, ``tyre``, ``track``, ``day``.
    most : int
        Recordings of a group that are used, evenly chosen in the order of days and paths.
    """
    groups = groups_of(recordings_of(paths_or_table), [by] if isinstance(by, str) else list(by), most)
    return _run(groups, out, GROUPS, engine, rig, map, resume, Options(timeout_s=timeout_s), progress, of_engine)


def _run(
    units: Sequence[Unit],
    out: str | os.PathLike[str],
    schema: Any,
    engine: Engine,
    rig: Rigs,
    map: Maps,
    resume: bool,
    options: Options,
    progress: Progress,
    of_engine: dict[str, Any],
) -> Counts:
    if engine not in ENGINES:
        raise MuslipError(f"error: engine {engine!r}: must be one of {', '.join(ENGINES)}")
    members = [one for unit in units for one in unit.members]
    rigs = rigs_of(rig, {one.rig for one in members})
    maps = maps_of(map, {one.map for one in members})
    results = Results.made(os.fspath(out), schema, len(units))
    plan = Plan(results, Asked.of(units, rigs, maps, options), resume, os.getcwd())
    before = made_of(results) if resume else {}
    parts: dict[str, list[Unit]] = {}
    for unit in units:
        parts.setdefault(results.part_of(unit.key), []).append(unit)
    with _Bar(progress, "fleet") as tell:
        worked = 0

        def told(more: int) -> None:
            nonlocal worked
            worked += more
            if tell is not None:
                tell(worked / len(units), "fleet")

        ENGINES[engine]([(name, tuple(of)) for name, of in sorted(parts.items())], plan, told, **of_engine)
    return _counted(units, plan, before)


def _counted(units: Sequence[Unit], plan: Plan, before: dict[str, Made]) -> Counts:
    """What was done, by what the data set says now: every one has its row, and one row."""
    after = made_of(plan.results)
    done = skipped = failed = 0
    for unit in units:
        made = after.get(unit.key)
        if made is None or (made.version, made.settings) != (plan.asked.version, plan.asked.settings_of(unit)):
            raise RuntimeError(f"{unit.key}: the run has ended without a row for it in {plan.results.folder.path}")
        if made.fingerprint is not None and before.get(unit.key) == made:
            skipped += 1
        elif made.error is None:
            done += 1
        else:
            failed += 1
    return Counts(done, skipped, failed)
