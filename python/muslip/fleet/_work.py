"""The work of one part of the results, whatever engine asks for it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterable
from dataclasses import dataclass

import muslip

from .._errors import MuslipError
from . import _child
from ._process import Maps, Options, Rigs, Row, Unit, computed, fingerprint_of, settings_of
from ._results import Results, full

FLUSH_S = 10.0
"""How much work a kill may cost: so often a part is written while its rows are computed."""

Part = tuple[str, tuple[Unit, ...]]


@dataclass(frozen=True)
class Asked:
    """What is asked of every recording or group."""

    rigs: Rigs
    maps: Maps
    options: Options
    version: str
    settings: dict[tuple[str | None, str | None], str]
    """The hash of what else than recording and version decides a row, by the keys of rig and map."""

    @classmethod
    def of(cls, units: Iterable[Unit], rigs: Rigs, maps: Maps, options: Options) -> Asked:
        """The same with its hashes, of these recordings or groups."""
        keys = {(one.rig, one.map) for unit in units for one in unit.members}
        settings = {(rig, map): settings_of(rigs[rig], maps[map], options) for rig, map in keys}
        return cls(rigs, maps, options, muslip.__version__, settings)

    def settings_of(self, unit: Unit) -> str:
        """The hash of what else than recording and version decides its row."""
        return self.settings[unit.members[0].rig, unit.members[0].map]

    def row_of(self, unit: Unit, child: _child.Child | None, known: str | None = None) -> Row | None:
        """Its row, by a child where there is one, else worked out here; ``None`` where its fingerprint is the ``known`` one."""
        first = unit.members[0]
        rig, map = self.rigs[first.rig], self.maps[first.map]
        if len({self.settings[one.rig, one.map] for one in unit.members}) > 1:
            rig = MuslipError(f"error: {unit.key}: recordings of several rigs or maps: group by rig as well")
        work = (unit, rig, map, self.options, known)
        result = computed(*work) if child is None else _guarded(child, work, self.options.timeout_s)
        if result is None:
            return None
        return {"version": self.version, "settings": self.settings_of(unit), **unit.labels(), **result}


@dataclass(frozen=True)
class Plan:
    """What is to be done with every part of the results."""

    results: Results
    asked: Asked
    resume: bool
    folder: str
    """Where relative paths begin."""


def _guarded(child: _child.Child, work: tuple[object, ...], timeout_s: float | None) -> Row | None:
    start = time.perf_counter()
    died = ""
    for _ in range(2):
        try:
            row: Row | None = child.call(computed, *work, timeout_s=timeout_s)
            return row
        except _child.TooLong:
            result: Row = {"error": f"error: took longer than {timeout_s:g} s"}
            with contextlib.suppress(_child.TooLong, _child.Died):
                # It would again: a result, with the time that it may take among its settings.
                result["fingerprint"] = child.call(fingerprint_of, work[0], timeout_s=timeout_s)
            return result | {"seconds": time.perf_counter() - start}
        except _child.Died as error:
            # Once more: whoever was killed from outside is not at fault.
            died = str(error)
    return {"error": f"error: its process died twice: {died}", "seconds": time.perf_counter() - start}


def work_on(part: Part, plan: Plan, child: _child.Child) -> int:
    """Bring one part of the results up to date; answers with the number of its recordings or groups.

    What is there of the same recording, version and settings stays; the rest is worked out and written, part by part, whole.
    """
    if plan.asked.version != muslip.__version__:
        raise RuntimeError(f"muslip {muslip.__version__} here, {plan.asked.version} where the run was started")
    name, units = part
    rows = plan.results.rows(name)
    written, is_changed = time.monotonic(), False
    for unit in units:
        before = rows.get(unit.key)
        made = (plan.asked.version, plan.asked.settings_of(unit))
        known = before["fingerprint"] if before and plan.resume and (before["version"], before["settings"]) == made else None
        row = plan.asked.row_of(unit, child, known)
        if row is None and before is not None:
            row = {**before, **unit.labels()}
        if row is not None:
            row = full(row, plan.results.schema)
            is_changed |= row != before
            rows[unit.key] = row
        if is_changed and time.monotonic() - written > FLUSH_S:
            plan.results.write(name, rows.values())
            written, is_changed = time.monotonic(), False
    if is_changed:
        plan.results.write(name, rows.values())
    return len(units)
