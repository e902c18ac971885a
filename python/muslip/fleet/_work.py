"""The work of parts of the results, whatever engine asks for it."""

from __future__ import annotations

import contextlib
import itertools
import time
from collections.abc import Generator, Iterable, Sequence
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

    def work_of(self, unit: Unit, known: str | None = None) -> Work:
        """What is to be computed for its row, where its fingerprint is not the ``known`` one."""
        if len({self.settings[one.rig, one.map] for one in unit.members}) > 1:
            return unit, MuslipError(f"error: {unit.key}: recordings of several rigs or maps: group by rig as well"), known
        return unit, None, known

    def needed_by(self, units: Iterable[Unit]) -> tuple[Rigs, Maps, Options]:
        """The rigs and maps of these alone, and the options."""
        first = [unit.members[0] for unit in units]
        return {one.rig: self.rigs[one.rig] for one in first}, {one.map: self.maps[one.map] for one in first}, self.options

    def made(self, unit: Unit, result: Row) -> Row:
        """The whole row of a result."""
        return {"version": self.version, "settings": self.settings_of(unit), **unit.labels(), **result}

    def row_of(self, unit: Unit, child: _child.Child | None) -> Row:
        """Its row, by a child where there is one, else worked out here."""
        work, needed = self.work_of(unit), self.needed_by([unit])
        result = _worked(*work, *needed) if child is None else next(_guarded(child, [work], needed))
        assert result is not None
        return self.made(unit, result)


Work = tuple[Unit, MuslipError | None, str | None]


def _worked(unit: Unit, wrong: MuslipError | None, known: str | None, rigs: Rigs, maps: Maps, options: Options) -> Row | None:
    first = unit.members[0]
    return computed(unit, wrong or rigs[first.rig], maps[first.map], options, known)


@dataclass(frozen=True)
class Plan:
    """What is to be done with every part of the results."""

    results: Results
    asked: Asked
    resume: bool
    folder: str
    """Where relative paths begin."""


def _guarded(child: _child.Child, works: list[Work], needed: tuple[Rigs, Maps, Options]) -> Generator[Row | None, None, None]:
    """The result of one after the other, by a child; a row as well where it takes too long, or its process dies of it."""
    timeout_s = needed[2].timeout_s
    left = list(works)
    deaths = 0
    while left:
        # A row is charged with its work, and not with the start of a process.
        child.ready()
        start = time.perf_counter()
        given = left[:1] if deaths else list(left)
        try:
            for result in child.each(_worked, given, *needed, timeout_s=timeout_s):
                del left[0]
                deaths = 0
                yield result
                start = time.perf_counter()
            continue
        except _child.TooLong:
            failed: Row = {"error": f"error: took longer than {timeout_s:g} s", "seconds": time.perf_counter() - start}
            with contextlib.suppress(_child.TooLong, _child.Died):
                # It would again: a result, with the time that it may take among its settings.
                failed["fingerprint"] = child.call(fingerprint_of, left[0][0], timeout_s=timeout_s)
        except _child.Died as error:
            # Once more, and one at a time: who was killed from outside is not at fault, nor is who came before the one that is.
            deaths += 1
            if deaths < 2:
                continue
            failed = {"error": f"error: its process died twice: {error}", "seconds": time.perf_counter() - start}
        del left[0]
        deaths = 0
        yield failed


def work_on(parts: Sequence[Part], plan: Plan, child: _child.Child) -> list[int]:
    """Bring parts of the results up to date; answers with the number of recordings or groups of each.

    What is there of the same recording, version and settings stays; the rest is worked out and written, part by part, whole.
    The child is given all of it at once, and computes while parts are written.
    """
    if plan.asked.version != muslip.__version__:
        raise RuntimeError(f"muslip {muslip.__version__} here, {plan.asked.version} where the run was started")
    there = [plan.results.rows(name) for name, _ in parts]
    works = []
    for (_, units), rows in zip(parts, there, strict=True):
        for unit in units:
            before = rows.get(unit.key)
            made = (plan.asked.version, plan.asked.settings_of(unit))
            is_known = before is not None and plan.resume and (before["version"], before["settings"]) == made
            works.append(plan.asked.work_of(unit, before["fingerprint"] if before is not None and is_known else None))
    needed = plan.asked.needed_by(unit for _, units in parts for unit in units)
    with contextlib.closing(_guarded(child, works, needed)) as results:
        for (name, units), rows in zip(parts, there, strict=True):
            _bring(name, rows, zip(units, itertools.islice(results, len(units)), strict=True), plan)
    return [len(units) for _, units in parts]


def _bring(name: str, there: dict[str, Row], results: Iterable[tuple[Unit, Row | None]], plan: Plan) -> None:
    """Bring one part up to date with results, and every few seconds as far as they have come."""
    changed: dict[str, Row] = {}
    written = time.monotonic()
    for unit, result in results:
        before = there.get(unit.key)
        if result is not None:
            row = plan.asked.made(unit, result)
        else:
            assert before is not None
            row = {**before, **unit.labels()}
        row = full(row, plan.results.schema)
        if row != before:
            changed[unit.key] = row
        if changed and time.monotonic() - written > FLUSH_S:
            plan.results.update(name, changed)
            written, changed = time.monotonic(), {}
    if changed:
        plan.results.update(name, changed)
