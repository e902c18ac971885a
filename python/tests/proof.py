"""A fleet through Spark's local cluster, with all that goes wrong: how fast beside a plain loop, none lost and none twice.

`cargo xtask fleet` runs this in an environment with pyspark; its executors have pandas and pyarrow. In the tests it is small.
Everything printed is measured; what does not hold ends it with an error.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import pathlib
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import pandas
import pyspark

sys.path.insert(0, os.path.dirname(__file__))
import fleets

import muslip
from muslip.fleet import Counts, run

REPOSITORY = pathlib.Path(__file__).parents[2]
CORES = 2
RATIO = 0.8
"""Of a plain loop's recordings a second a core, what Spark has to reach."""
FEWEST_TO_MEASURE = 10_000
"""Fewer are over before Spark is warm."""
EXECUTOR = "CoarseGrainedExecutorBackend"
LOOP = """
import sys, time
import muslip
from muslip.fleet import process
rig = muslip.Rig.from_toml(sys.argv[1])
paths = sys.stdin.read().split()
process(paths[0], rig)
start = time.perf_counter()
for path in paths:
    assert process(path, rig)["error"] is None, path
print(len(paths) / (time.perf_counter() - start))
"""


def submitted() -> list[str]:
    """The one line of the README, as a shell would take it apart."""
    (line,) = re.findall(r"^spark-submit .*$", (REPOSITORY / "README.md").read_text(), re.M)
    return shlex.split(line)


PROCESSES = {"executor (JVM)": EXECUTOR, "its Python worker": "pyspark.daemon", "the child that works": "muslip.fleet._child"}


def peak_mb(process: int) -> float:
    """The most memory that a process has had, in MB."""
    with contextlib.suppress(OSError):
        found = re.search(r"^VmHWM:\s+(\d+) kB", pathlib.Path(f"/proc/{process}/status").read_text(), re.M)
        return int(found.group(1)) / 1024 if found else 0.0
    return 0.0


class Submission:
    """A ``spark-submit`` with all its processes."""

    def __init__(self, arguments: list[str], folder: pathlib.Path, executor: str) -> None:
        environment = {
            **os.environ, "PYSPARK_PYTHON": executor, "PYSPARK_DRIVER_PYTHON": sys.executable, "SPARK_LOCAL_IP": "127.0.0.1",
            "PATH": os.pathsep.join([os.path.dirname(sys.executable), os.environ["PATH"]]),
        }  # fmt: skip
        self.log = folder / "spark.log"
        self.peak_mb: dict[str, float] = {}
        with self.log.open("ab") as log:
            self.driver = subprocess.Popen(
                arguments, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=log, text=True, start_new_session=True,
            )  # fmt: skip

    def counts(self) -> Counts:
        """Wait for its end; what it counted."""
        while self.driver.poll() is None:
            for name, words in PROCESSES.items():
                self.peak_mb[name] = max([self.peak_mb.get(name, 0.0), *map(peak_mb, self.processes(words))])
            time.sleep(0.2)
        printed, _ = self.driver.communicate()
        assert self.driver.returncode == 0, f"status {self.driver.returncode}, {printed}\n{self.log.read_text()[-4000:]}"
        found = re.search(r"^done (\d+), skipped (\d+), failed (\d+)$", printed, re.M)
        assert found, printed
        return Counts(*map(int, found.groups()))

    def processes(self, words: str) -> list[int]:
        """Those of its processes whose command line has these words."""
        found = []
        for entry in pathlib.Path("/proc").iterdir():
            if entry.name.isdigit():
                with contextlib.suppress(OSError):
                    if os.getsid(int(entry.name)) == self.driver.pid and words in (entry / "cmdline").read_text():
                        found.append(int(entry.name))
        return found

    def kill(self) -> None:
        """End the driver at once, as a machine does that loses power; its executors with it."""
        os.killpg(self.driver.pid, signal.SIGKILL)
        self.driver.wait()


def say(what: str) -> None:
    """Print it at once."""
    print(what, flush=True)


def there(out: pathlib.Path) -> int:
    return len(list(out.glob("part-*")))


@contextlib.contextmanager
def timed(name: str) -> Iterator[list[float]]:
    start, taken = time.monotonic(), [0.0]
    yield taken
    taken[0] = time.monotonic() - start
    say(f"{name}: {taken[0]:.1f} s")


def loop(rig: pathlib.Path, paths: list[str]) -> float:
    """Recordings a second a core of a plain loop over `process`, on as many cores at once as Spark has."""
    loops = []
    for core in range(CORES):
        environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
        one = subprocess.Popen(
            [sys.executable, "-c", LOOP, rig], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )
        assert one.stdin is not None
        one.stdin.write("\n".join(paths[core::CORES]))
        one.stdin.close()
        loops.append(one)
    rates = []
    for one in loops:
        assert one.stdout is not None
        rates.append(float(one.stdout.read()))
        assert one.wait() == 0
    return sum(rates) / len(rates)


def check(name: str, out: pathlib.Path, paths: list[str], failed: int, counts: Counts) -> None:
    """One row each, and the counts are of all of them."""
    frame = pandas.read_parquet(out)
    assert sorted(frame.iloc[:, 0]) == sorted(paths), f"{name}: rows are missing, or there twice"
    assert frame["error"].notna().sum() == failed, frame.loc[frame["error"].notna(), ["error"]]
    assert counts.done + counts.skipped + counts.failed == len(paths)
    rows = f"{len(frame)} rows, {frame.iloc[:, 0].nunique()} different, {failed} with an error"
    say(f"{name}: {len(paths)} asked, {rows}; {counts}")


def faults(folder: pathlib.Path, submit: Callable[..., Submission], paths: list[str]) -> None:
    """A corrupt file, one that never ends, an executor killed in mid-run, the driver killed, and the run begun again."""
    torn = folder / "torn.csv"
    shutil.copy(folder / paths[0], torn)
    fleets.corrupt(str(torn))
    asked = [*paths, "torn.csv", os.path.basename(fleets.endless(folder))]
    pandas.DataFrame({"path": asked}).to_csv(folder / "faults.csv", index=False)
    out = folder / "results-faults"
    first = submit("--table=faults.csv", "results-faults", "run", "--timeout", "2")

    def wait_for(share: float) -> None:
        while there(out) < share * whole:
            assert first.driver.poll() is None, "it was over before anything could be killed"
            time.sleep(0.005)

    whole = min(256, len(asked) // 2)
    wait_for(0.2)
    executors = first.processes(EXECUTOR)
    os.kill(executors[0], signal.SIGKILL)
    wait_for(0.6)
    first.kill()
    before = pandas.read_parquet(out)
    assert 0 < len(before) < len(asked) and before["path"].is_unique
    say(f"killed: 1 of {len(executors)} executors, then the driver; {len(before)} of {len(asked)} rows were there")
    counts = submit("--table=faults.csv", "results-faults", "run", "--timeout", "2").counts()
    check("begun again", out, asked, 2, counts)
    assert counts.skipped == before["fingerprint"].notna().sum()
    frame = pandas.read_parquet(out).set_index("path")
    say("\n".join(f"  {path}: {frame.loc[path, 'error']}" for path in asked[-2:]))
    # The same run by a pool: it finds Spark's rows.
    with contextlib.chdir(folder):
        counts = run({"path": asked}, out, rig="rig.toml", timeout_s=2.0)
    check("by a pool", out, asked, 2, counts)
    assert counts == Counts(done=0, skipped=len(asked) - 1, failed=1)
    # And by Ray, a few anew.
    os.environ |= {"RAY_AUTH_MODE": "disabled", "RAY_USAGE_STATS_ENABLED": "0"}
    few = [str(folder / path) for path in [*paths[:50], "torn.csv"]]
    check("by Ray", folder / "results-ray", few, 1, run(few, folder / "results-ray", engine="ray", rig=folder / "rig.toml"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=100_000)
    parser.add_argument("--diagnoses", type=int, default=1_000)
    parser.add_argument("--large", type=int, default=200)
    parser.add_argument("--executor", required=True, help="a python with pandas and pyarrow")
    parser.add_argument("--wheel", required=True)
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    given = parser.parse_args()
    folder: pathlib.Path = given.folder.absolute()
    executor = os.path.abspath(given.executor)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "python").symlink_to(REPOSITORY / "python")
    shutil.copy(given.wheel, folder / "muslip.zip")
    rig = fleets.rig(folder)
    versions = f"pyspark {pyspark.__version__}, pandas {pandas.__version__}, {sys.version.split()[0]}"
    say(f"muslip {muslip.__version__}, {versions}, {CORES} cores")

    def submit(pattern: str, out: str, command: str = "run", *more: str) -> Submission:
        words = submitted()
        at = words.index("run")
        return Submission(
            [*words[:at], command, pattern, "--rig", "rig.toml", "--out", out, "--engine", "spark", *more], folder, executor
        )

    with timed(f"{given.recordings} small recordings made"):
        paths = fleets.small(folder / "runs", given.recordings)
    size = sum(os.path.getsize(path) for path in paths) / len(paths)
    relative = [os.path.relpath(path, folder) for path in paths]

    # The README's line as it stands.
    with timed("spark-submit, all of it") as whole:
        submission = Submission(submitted(), folder, executor)
        counts = submission.counts()
    say("most memory of one: " + ", ".join(f"{name} {peak:.0f} MB" for name, peak in submission.peak_mb.items()))
    ours = [path for path in relative if path.endswith(".csv")]
    check("the README's line", folder / "results", ours, 0, counts)
    ratios = []
    if given.recordings >= FEWEST_TO_MEASURE:
        written = sorted(path.stat().st_mtime for path in (folder / "results").glob("part-*"))
        rate = loop(rig, paths[: given.recordings // 20])
        # What the first part waited for is Spark's start.
        spark = len(ours) * (len(written) - 1) / len(written) / (written[-1] - written[0]) / CORES
        started = len(ours) / whole[0] / CORES
        ratios.append(spark / rate)
        rates = f"loop {rate:.1f}, Spark {spark:.1f}, ratio {spark / rate:.2f}"
        say(f"small recordings of {size / 1024:.1f} kB, a second a core: {rates}")
        say(f"with Spark's start {started:.1f}, ratio {started / rate:.2f}")

    faults(folder, submit, relative[:10_000])

    if given.large:
        with timed(f"{given.large} large recordings made"):
            large = fleets.small(folder / "large", given.large, rate_hz=1000.0, duration_s=60.0)
        size = sum(os.path.getsize(path) for path in large) / len(large)
        with timed("spark-submit, all of it"):
            counts = submit("large/*", "results-large").counts()
        check("large", folder / "results-large", [os.path.relpath(path, folder) for path in large], 0, counts)
        written = sorted(path.stat().st_mtime for path in (folder / "results-large").glob("part-*"))
        seconds = pandas.read_parquet(folder / "results-large")["seconds"]
        rate = loop(rig, large[: max(2 * CORES, given.large // 5)])
        spark = given.large / (written[-1] - written[0] + seconds.mean()) / CORES
        ratios.append(spark / rate)
        rates = f"loop {rate:.2f}, Spark {spark:.2f}, ratio {spark / rate:.2f}"
        say(f"large recordings of {size / 2**20:.1f} MB, a second a core: {rates}")

    if given.diagnoses:
        longer = fleets.small(folder / "longer", 3 * given.diagnoses, rate_hz=250.0, duration_s=2.0)
        groups = [f"tyre-{index // 3:05}" for index in range(len(longer))]
        pandas.DataFrame({"path": [os.path.relpath(path, folder) for path in longer], "tyre": groups}).to_csv(
            folder / "groups.csv", index=False
        )
        with timed(f"{given.diagnoses} diagnoses of three recordings each, spark-submit, all of it"):
            counts = submit("--table=groups.csv", "diagnoses", "diagnose", "--by", "tyre").counts()
        check("diagnoses", folder / "diagnoses", sorted(set(groups)), 0, counts)

    assert all(ratio >= RATIO for ratio in ratios), f"a core does less than {RATIO} of a loop's"


if __name__ == "__main__":
    main()
