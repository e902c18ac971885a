"""The fleet as a command: ``python -m muslip.fleet``, or this file for ``spark-submit``."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from muslip import MuslipError
from muslip.fleet import diagnose, run, summary, to_delta
from muslip.fleet._results import read
from muslip.fleet._storage import opened


def _table(path: str) -> Any:
    import pandas

    if path.endswith(".parquet"):
        with opened(path) as stream:
            return read(stream.read()).to_pandas(use_threads=False)
    return pandas.read_csv(path, dtype=str)


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m muslip.fleet", description="Estimates and diagnoses of a fleet of recordings."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("recordings", nargs="*", help="paths and patterns, as runs/**/*.mf4")
    common.add_argument(
        "--table", help="instead: a CSV or Parquet file with path and, where there are such, rig, map, tyre, track, day"
    )
    common.add_argument("--out", required=True, help="folder of the Parquet data set")
    common.add_argument("--rig", help="the rig file of all; without it, the table's column rig has the files")
    common.add_argument("--map", help="the map of all")
    common.add_argument("--engine", choices=("pool", "spark", "ray"), default="pool")
    common.add_argument("--timeout", type=float, metavar="S", help="how long a row may take")
    common.add_argument("--anew", action="store_true", help="also what is there already")
    runs = commands.add_parser("run", parents=[common], help="estimate every recording")
    runs.add_argument("--diagnose", action="store_true", help="diagnose each as well, by itself")
    groups = commands.add_parser(
        "diagnose", parents=[common], help="diagnose the recordings of a rig, tyre, track or day together"
    )
    groups.add_argument("--by", default="rig", help="columns that are the same within a group, as rig,tyre")
    groups.add_argument("--most", type=int, default=12, help="recordings of a group that are used")
    whole = commands.add_parser("summary", help="the fleet as a whole")
    whole.add_argument("results", help="the data set of run")
    whole.add_argument("--diagnoses", help="the data set of diagnose")
    whole.add_argument("--report", required=True, help="the page")
    delta = commands.add_parser("delta", help="the data set as a Delta table")
    delta.add_argument("results", help="the data set of run or diagnose")
    delta.add_argument("--table", required=True, help="folder of the table")
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Do what the command line says; answers with the exit status of the command ``muslip``: 2 for input that cannot be used."""
    parser = _arguments()
    given = parser.parse_args(arguments)
    try:
        if given.command == "summary":
            found = summary(given.results, given.diagnoses)
            found.report(given.report)
            print(f"peak friction {found.peak_friction}, critical slip {found.critical_slip}")
            print(f"{found.estimated} of {found.recordings} recordings, {len(found.outliers)} estimates that stand out")
            return 0
        if given.command == "delta":
            print(f"version {to_delta(given.results, given.table)}")
            return 0
        if bool(given.recordings) == bool(given.table):
            parser.error("either recordings or --table")
        asked = given.recordings or _table(given.table)
        common: dict[str, Any] = {"engine": given.engine, "rig": given.rig, "map": given.map, "resume": not given.anew}
        if given.timeout is not None:
            common["timeout_s"] = given.timeout
        if given.command == "run":
            counts = run(asked, given.out, diagnose=given.diagnose, **common)
        else:
            counts = diagnose(asked, given.out, given.by.split(","), most=given.most, **common)
    except MuslipError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"done {counts.done}, skipped {counts.skipped}, failed {counts.failed}")
    return 0


if __name__ == "__main__":
    status: int = main()
    # spark-submit takes any SystemExit for a failure.
    if status:
        sys.exit(status)
