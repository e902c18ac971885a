"""Fleets for the tests: recordings of simulated rigs as small files."""

from __future__ import annotations

import os
import pathlib
import time

import pyarrow
import pyarrow.csv

import muslip
from muslip.fleet import _work

WORKED = _work._worked

RIG = dict(
    radius_m=0.31, inertia_kg_m2=1.25, mass_kg=420.0, torque_per_pressure_nm_pa=3.2e-4, peak_friction=0.85,
    critical_slip=0.14, noise={"drag_force_n": 90.0, "wheel_speed_rad_s": 0.15},
)  # fmt: skip


def rig(folder: pathlib.Path) -> pathlib.Path:
    """A rig file."""
    path = folder / "rig.toml"
    muslip.Rig(**RIG).to_toml(path)
    return path


def small(folder: pathlib.Path, count: int, first: int = 1, rate_hz: float = 100.0, duration_s: float = 1.0) -> list[str]:
    """As many recordings, each of its own noise: CSV, and every tenth one Parquet."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for seed in range(first, first + count):
        run = muslip.simulate(muslip.Rig(**RIG), seed=seed, rate_hz=rate_hz, duration_s=duration_s, applications=1).to_arrow()
        path = folder / f"run{seed:06}.{'parquet' if seed % 10 == 0 else 'csv'}"
        if path.suffix == ".csv":
            pyarrow.csv.write_csv(run, path, pyarrow.csv.WriteOptions(quoting_style="none"))
        else:
            pyarrow.parquet.write_table(run, path)
        paths.append(str(path))
    return paths


def corrupt(path: str) -> None:
    """Tear a file within its first rows."""
    text = pathlib.Path(path).read_bytes()
    pathlib.Path(path).write_bytes(text[: len(text) // 2].replace(b",", b",x", 3))


def endless(folder: pathlib.Path) -> str:
    """A file that never ends, nor begins: a pipe that nobody writes into."""
    path = folder / "endless.csv"
    os.mkfifo(path)
    return str(path)


def squared_or_worse(value):
    """A square; as negative as that, it ends its process or never comes back."""
    if value == -1:
        os.abort()
    if value == -2:
        time.sleep(60)
    return value * value


def aborting_on_the_fourth(unit, *work):
    """What is computed for a row, but for one recording that ends its process."""
    if unit.key.endswith("run000004.csv"):
        os.abort()
    return WORKED(unit, *work)
