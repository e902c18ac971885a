"""Converts and lists files that are larger than memory should be, and prints what each took: large.py FOLDER MUSLIP [ROWS].

Writes a CSV of ROWS rows (10^8 where it is not given) and an MDF 4 of ROWS/10 records of 25 channels, of which three are mapped beside one of a slower
group (2 GB at 10^8), runs
`muslip channels` and `muslip convert` on them, and prints their time and the most memory that they ever had.
"""

import contextlib
import pathlib
import subprocess
import sys
import time

import numpy as np

BLOCK = 100_000


def columns(first, count):
    """Some rows of a wheel that is braked again and again."""
    t = (first + np.arange(count)) / 1000.0
    slip = 0.15 * (1 - np.cos(2 * np.pi * t / 4.0))
    x = slip / 0.12
    friction = 0.9 * 2 * x / (1 + x * x)
    return {"time_s": t, "wheel": 20.0 * (1 - slip) / 0.31, "speed": np.full(count, 72.0), "drag": 4.0 * friction, "load": np.full(count, 4.0)}


def csv(path, rows):
    # A block is whole periods of the brake: but for the time its rows are those of every other one.
    block = columns(0, BLOCK)
    block.pop("time_s")
    rest = [";" + ";".join(f"{value:.6g}" for value in row) + ";x\n" for row in zip(*block.values())]
    with open(path, "w", encoding="utf-8") as out:
        out.write("Zeit [s];Raddrehzahl [rad/s];Geschwindigkeit [km/h];Bremskraft [kN];Radlast [kN];Text\n")
        for first in range(0, rows, BLOCK):
            lines = [f"{k // 1000}.{k % 1000:03d}{text}" for k, text in zip(range(first, min(first + BLOCK, rows)), rest)]
            out.write("".join(lines))


def mdf(path, rows):
    from asammdf import MDF, Signal

    units = {"wheel": "rad/s", "speed": "km/h", "drag": "kN", "load": "kN"}
    names = {"wheel": "Raddrehzahl", "speed": "Geschwindigkeit", "drag": "Bremskraft", "load": "Radlast"}

    def groups(first, count):
        """The readings of each group: the load has a time of its own, at a tenth of the rate."""
        some = columns(first, count)
        t, load = some.pop("time_s"), some.pop("load")
        mapped = [Signal(v, t, name=names[k], unit=units[k]) for k, v in some.items()]
        others = [Signal(t * k, t, name=f"unmapped{k}", unit="V") for k in range(22)]
        return [mapped + others, [Signal(load[::10], t[::10], name=names["load"], unit=units["load"])]]

    many = 10 * BLOCK
    with MDF(version="4.10") as out:
        for signals in groups(0, min(many, rows)):
            out.append(signals)
        for first in range(many, rows, many):
            for at, signals in enumerate(groups(first, min(many, rows - first))):
                out.extend(at, [(signals[0].timestamps, None)] + [(one.samples, None) for one in signals])
        out.save(path, overwrite=True)


def run(arguments):
    """Runs a command; answers with its seconds and its peak of memory in MiB."""
    start = time.perf_counter()
    child = subprocess.Popen(arguments, stdout=subprocess.DEVNULL)
    peak = 0
    while child.poll() is None:
        try:
            status = pathlib.Path(f"/proc/{child.pid}/status").read_text()
        except OSError:
            break
        for line in status.splitlines():
            if line.startswith("VmHWM:"):
                peak = max(peak, int(line.split()[1]) / 1024)
        time.sleep(0.01)
    if child.wait() != 0:
        sys.exit(f"{arguments}: status {child.returncode}")
    return time.perf_counter() - start, peak


def main():
    folder, muslip = pathlib.Path(sys.argv[1]), sys.argv[2]
    rows = int(float(sys.argv[3])) if len(sys.argv) > 3 else 100_000_000
    folder.mkdir(parents=True, exist_ok=True)
    print("| file | rows | MB | command | s | most memory, MiB |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name, write, count in [("large.csv", csv, rows), ("large.mf4", mdf, rows // 10)]:
        path, out = folder / name, folder / "out.csv"
        # asammdf tells how fast it packs, and that is no line of the table.
        with contextlib.redirect_stdout(sys.stderr):
            write(path, count)
        megabytes = path.stat().st_size / 1e6
        for words in [["channels", path], ["convert", "--out", out, path], ["convert", "--out", folder / "out.parquet", path]]:
            seconds, peak = run([muslip, *words])
            said = " ".join(str(word).split("/")[-1] for word in words)
            print(f"| {name} | {count:.0e} | {megabytes:.0f} | muslip {said} | {seconds:.0f} | {peak:.0f} |", flush=True)
        path.unlink()
        for left in [out, folder / "out.parquet"]:
            left.unlink(missing_ok=True)


if __name__ == "__main__":
    main()
