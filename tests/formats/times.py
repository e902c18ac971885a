"""Times the readers beside the programs that the field uses, in one run: times.py FOLDER READER.

Writes files of 10^7 samples (a time and four channels, 2 x 10^6 rows) into FOLDER, reads each by the other program and by READER (the program
`time-reading` of this crate) in turn, and prints a table in Markdown with the least of each. Both read every channel into memory as numbers. What
is told is processor time: it does not hang on what else the machine does, and threads that work at once count each.
"""

import pathlib
import resource
import subprocess
import sys
import time

import numpy as np

ROWS = 2_000_000
TURNS = 3


def files(folder):
    """Writes the files; answers with (name, other program, how that reads it)."""
    import pandas as pd
    import scipy.io
    from asammdf import MDF, Signal
    from nptdms import ChannelObject, TdmsFile, TdmsWriter

    rng = np.random.default_rng(20405)
    columns = {"t": np.arange(ROWS) / 1000.0}
    for name in ["wheel", "speed", "drag", "load"]:
        columns[name] = np.round(rng.normal(size=ROWS) * 100, 4)

    def mdf(compression):
        path = folder / f"times-{compression}.mf4"
        with MDF(version="4.10") as out:
            out.append([Signal(v, columns["t"], name=k, unit="N") for k, v in columns.items() if k != "t"])
            out.save(path, overwrite=True, compression=compression)
        return path

    def read_mdf(path):
        with MDF(path) as file:
            got = [file.get(name) for name in columns if name != "t"]
            return sum(len(one.samples) for one in got) + len(got[0].timestamps)

    yield "MDF 4", "asammdf", mdf(0), read_mdf
    yield "MDF 4, deflated", "asammdf", mdf(1), read_mdf

    path = folder / "times.tdms"
    with TdmsWriter(path) as out:
        out.write_segment([ChannelObject("run", k, v) for k, v in columns.items()])
    yield "TDMS", "npTDMS", path, lambda path: sum(len(c[:]) for c in TdmsFile.read(path)["run"].channels())

    for packed in [False, True]:
        path = folder / f"times-{packed}.mat"
        scipy.io.savemat(path, columns, do_compression=packed)
        yield "MAT v5" + (", deflated" if packed else ""), "scipy", path, lambda path: sum(
            v.size for k, v in scipy.io.loadmat(path).items() if not k.startswith("__")
        )

    frame = pd.DataFrame(columns)
    path = folder / "times.csv"
    frame.to_csv(path, index=False)
    yield "CSV", "pandas", path, lambda path: pd.read_csv(path).size
    path = folder / "times-german.csv"
    frame.to_csv(path, index=False, sep=";", decimal=",")
    yield "CSV, decimal comma", "pandas", path, lambda path: pd.read_csv(path, sep=";", decimal=",").size
    path = folder / "times.parquet"
    frame.to_parquet(path)
    yield "Parquet", "pandas", path, lambda path: pd.read_parquet(path).size


def of_children():
    """Processor time of the processes that were waited for, in s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main():
    folder, reader = pathlib.Path(sys.argv[1]), sys.argv[2]
    folder.mkdir(parents=True, exist_ok=True)
    print("| file | MB | read by | s | here, s | other / here |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name, other, path, read in files(folder):
        theirs, ours = [], []
        for _ in range(TURNS):
            start = time.process_time()
            samples = read(path)
            theirs.append(time.process_time() - start)
            start = of_children()
            _, count, _ = subprocess.run([reader, path], check=True, capture_output=True, text=True).stdout.split()
            ours.append(of_children() - start)
            if samples != 5 * ROWS or int(count) != samples:
                sys.exit(f"{name}: {other} read {samples} samples, this reader {count}, written were {5 * ROWS}")
        print(
            f"| {name} | {path.stat().st_size / 1e6:.0f} | {other} | {min(theirs):.2f} | {min(ours):.2f} | {min(theirs) / min(ours):.1f} |",
            flush=True,
        )
        path.unlink()


if __name__ == "__main__":
    main()
