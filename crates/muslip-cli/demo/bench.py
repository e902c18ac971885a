"""Writes bench.mf4: run.csv as a bench would have recorded it, with German names, km/h, 1/min and kN, and the wheel load at a quarter of the rate.

Needs asammdf 8.8.28 and pandas (tests/formats/requirements.txt).
"""

import datetime
import math
import pathlib

import pandas
from asammdf import MDF, Signal

HERE = pathlib.Path(__file__).parent
run = {name: column.to_numpy() for name, column in pandas.read_csv(HERE / "run.csv", comment="#").items()}
time = run["time_s"]


def signal(name, unit, values, every=1):
    return Signal(values[::every], time[::every], name=name, unit=unit)


file = MDF(version="4.10")
file.start_time = datetime.datetime(2026, 3, 4, 9, 15, 0, tzinfo=datetime.timezone.utc)
file.append([signal("Raddrehzahl_VL", "1/min", run["wheel_speed_rad_s"] * 30 / math.pi)])
file.append([signal("Geschwindigkeit", "km/h", run["vehicle_speed_m_s"] * 3.6), signal("Bremskraft_VL", "kN", run["drag_force_n"] / 1000)])
file.append([signal("Radlast_VL", "kN", run["normal_force_n"] / 1000, every=4)])
file.save(HERE / "bench.mf4", overwrite=True, compression=2)
