"""A fleet through Spark's local cluster, with all that goes wrong: how fast beside a plain loop, none lost and none twice.

`cargo xtask fleet` runs this in an environment with pyspark; its executors have pandas and pyarrow. In the tests it is small.
Everything printed is measured; what does not hold ends it with an error.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import contextlib
import json
import multiprocessing
import os
import pathlib
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass

import pandas
import pyspark

sys.path.insert(0, os.path.dirname(__file__))
import fleets

import muslip
from muslip.fleet import Counts, run

# Of the machine, not of what is run: this is over before a second compiler pays, and nobody looks at Spark's page.
DEFAULTS = """\
spark.driver.extraJavaOptions -XX:TieredStopAtLevel=1 -XX:+UseSerialGC
spark.executor.extraJavaOptions -XX:TieredStopAtLevel=1 -XX:+UseSerialGC
spark.ui.enabled false
"""
REPOSITORY = pathlib.Path(__file__).parents[2]
CORES = 2
RATIO = 0.8
"""Of a plain loop's recordings a second a core, what Spark has to reach."""
FEWEST_TO_MEASURE = 10_000
"""Fewer are over before Spark is warm."""
EXECUTOR = "CoarseGrainedExecutorBackend"
SEVERAL = """
import json, sys, time
from pyspark.sql import SparkSession
from muslip.fleet.__main__ import main
session = SparkSession.builder.appName("muslip fleet").getOrCreate()
for words in json.loads(sys.argv[1]):
    start = time.monotonic()
    assert main(words) == 0
    print(f"took {time.monotonic() - start:.1f} s")
session.stop()
"""
"""Several commands in one session, whose start is half a minute of the processor."""
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
            **os.environ, "SPARK_CONF_DIR": str(folder / "conf"), "SPARK_LOCAL_IP": "127.0.0.1",
            "PYSPARK_PYTHON": executor, "PYSPARK_DRIVER_PYTHON": sys.executable,
            "PATH": os.pathsep.join([os.path.dirname(sys.executable), os.environ["PATH"]]),
        }  # fmt: skip
        self.log = folder / "spark.log"
        self.peak_mb: dict[str, float] = {}
        self.took_s: list[float] = []
        with self.log.open("ab") as log:
            self.driver = subprocess.Popen(
                arguments, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=log, text=True, start_new_session=True,
            )  # fmt: skip

    def counts(self) -> list[Counts]:
        """Wait for its end; what its commands counted."""
        while self.driver.poll() is None:
            for name, words in PROCESSES.items():
                self.peak_mb[name] = max([self.peak_mb.get(name, 0.0), *map(peak_mb, self.processes(words))])
            time.sleep(1.0)
        printed, _ = self.driver.communicate()
        assert self.driver.returncode == 0, f"status {self.driver.returncode}, {printed}\n{self.log.read_text()[-4000:]}"
        self.took_s = [float(seconds) for seconds in re.findall(r"^took ([\d.]+) s$", printed, re.M)]
        found = re.findall(r"^done (\d+), skipped (\d+), failed (\d+)$", printed, re.M)
        assert found, printed
        return [Counts(*map(int, counts)) for counts in found]

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


def made(folder: pathlib.Path, count: int, **of: float) -> list[str]:
    """As many recordings, by all cores."""
    share = -(-count // CORES)
    counts = [min(share, count - first) for first in range(0, count, share)]
    with concurrent.futures.ProcessPoolExecutor(CORES, multiprocessing.get_context("spawn")) as pool:
        of_each = [pool.submit(fleets.small, folder, some, 1 + index * share, **of) for index, some in enumerate(counts)]
        return [path for one in of_each for path in one.result()]


def read(paths: list[str]) -> None:
    """Read files once, so that neither of two that are compared waits for the disk."""
    for path in paths:
        pathlib.Path(path).read_bytes()


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


@dataclass(frozen=True)
class Cluster:
    """A folder with a rig and recordings, and who is submitted there."""

    folder: pathlib.Path
    executor: str

    def readme(self) -> Submission:
        """The README's line as it stands."""
        return Submission(submitted(), self.folder, self.executor)

    def words(self, pattern: str, out: str, command: str = "run", *more: str) -> list[str]:
        """The command of the README's line, of others."""
        return [command, pattern, "--rig", "rig.toml", "--out", out, "--engine", "spark", *more]

    def submit(self, *words: str) -> Submission:
        """The README's line with another command."""
        line = submitted()
        return Submission([*line[: line.index("run")], *words], self.folder, self.executor)

    def submit_all(self, commands: list[list[str]]) -> Submission:
        """As many commands in one session."""
        line = submitted()
        (self.folder / "several.py").write_text(SEVERAL)
        script = [*line[: line.index("run") - 1], "several.py", json.dumps(commands)]
        return Submission(script, self.folder, self.executor)


def start_ray() -> None:
    """Ray gives its node half a minute to start, in which a busy machine may not have come to it."""
    import ray

    for attempts_left in (2, 1, 0):
        try:
            ray.init(num_cpus=CORES)
            return
        except Exception:
            ray.shutdown()
            if attempts_left == 0:
                raise


def faults(cluster: Cluster, paths: list[str], diagnoses: int) -> None:
    """A corrupt file, one that never ends, an executor killed in mid-run, the driver killed, the run begun again; diagnoses."""
    folder = cluster.folder
    torn = folder / "torn.csv"
    shutil.copy(folder / paths[0], torn)
    fleets.corrupt(str(torn))
    asked = [*paths, "torn.csv", os.path.basename(fleets.endless(folder))]
    pandas.DataFrame({"path": asked}).to_csv(folder / "faults.csv", index=False)
    out = folder / "results-faults"
    words = cluster.words("--table=faults.csv", "results-faults", "run", "--timeout", "2")
    first = cluster.submit(*words)

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

    longer = made(folder / "longer", 3 * diagnoses, rate_hz=250.0, duration_s=2.0)
    groups = [f"tyre-{index // 3:05}" for index in range(len(longer))]
    pandas.DataFrame({"path": [os.path.relpath(path, folder) for path in longer], "tyre": groups}).to_csv(
        folder / "groups.csv", index=False
    )
    both = cluster.submit_all([words, cluster.words("--table=groups.csv", "diagnoses", "diagnose", "--by", "tyre")])
    again, diagnosed = both.counts()
    check("begun again", out, asked, 2, again)
    assert again.skipped == before["fingerprint"].notna().sum()
    frame = pandas.read_parquet(out).set_index("path")
    say("\n".join(f"  {path}: {frame.loc[path, 'error']}" for path in asked[-2:]))
    say(f"{diagnoses} diagnoses of three recordings each: {both.took_s[1]:.1f} s")
    check("diagnoses", folder / "diagnoses", sorted(set(groups)), 0, diagnosed)

    # The same run by a pool: it finds Spark's rows.
    with contextlib.chdir(folder):
        counts = run({"path": asked}, out, rig="rig.toml", timeout_s=2.0)
    check("by a pool", out, asked, 2, counts)
    assert counts == Counts(done=0, skipped=len(asked) - 1, failed=1)
    # And by Ray, a few anew.
    os.environ |= {"RAY_AUTH_MODE": "disabled", "RAY_USAGE_STATS_ENABLED": "0"}
    few = [str(folder / path) for path in [*paths[:50], "torn.csv"]]
    start_ray()
    with timed("by Ray"):
        counts = run(few, folder / "results-ray", engine="ray", rig=folder / "rig.toml")
    check("by Ray", folder / "results-ray", few, 1, counts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=100_000)
    parser.add_argument("--diagnoses", type=int, default=1_000)
    parser.add_argument("--large", type=int, default=400)
    parser.add_argument("--executor", required=True, help="a python with pandas and pyarrow")
    parser.add_argument("--wheel", required=True)
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    given = parser.parse_args()
    folder: pathlib.Path = given.folder.absolute()
    executor = os.path.abspath(given.executor)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "python").symlink_to(REPOSITORY / "python")
    (folder / "conf").mkdir()
    (folder / "conf" / "spark-defaults.conf").write_text(DEFAULTS)
    shutil.copy(given.wheel, folder / "muslip.zip")
    rig = fleets.rig(folder)
    versions = f"pyspark {pyspark.__version__}, pandas {pandas.__version__}, {sys.version.split()[0]}"
    say(f"muslip {muslip.__version__}, {versions}, {CORES} cores")

    cluster = Cluster(folder, executor)

    with timed(f"{given.recordings} small recordings made"):
        paths = made(folder / "runs", given.recordings)
    size = sum(os.path.getsize(path) for path in paths) / len(paths)
    relative = [os.path.relpath(path, folder) for path in paths]

    read(paths)
    with timed("spark-submit, all of it") as whole:
        submission = cluster.readme()
        (counts,) = submission.counts()
    say("most memory of one: " + ", ".join(f"{name} {peak:.0f} MB" for name, peak in submission.peak_mb.items()))
    ours = [path for path in relative if path.endswith(".csv")]
    check("the README's line", folder / "results", ours, 0, counts)
    ratios = []
    if given.recordings >= FEWEST_TO_MEASURE:
        written = sorted(path.stat().st_mtime for path in (folder / "results").glob("part-*"))
        rate = loop(rig, [str(folder / path) for path in ours])
        # What the first part waited for is Spark's start.
        spark = len(ours) * (len(written) - 1) / len(written) / (written[-1] - written[0]) / CORES
        started = len(ours) / whole[0] / CORES
        ratios.append(spark / rate)
        rates = f"loop {rate:.1f}, Spark {spark:.1f}, ratio {spark / rate:.2f}"
        say(f"small recordings of {size / 1024:.1f} kB, a second a core: {rates}; load {os.getloadavg()[0]:.0f}")
        say(f"with Spark's start {started:.1f}, ratio {started / rate:.2f}")

    faults(cluster, relative[:10_000], given.diagnoses)

    if given.large:
        with timed(f"{given.large} large recordings made"):
            large = made(folder / "large", given.large, rate_hz=1000.0, duration_s=60.0)
        size = sum(os.path.getsize(path) for path in large) / len(large)
        read(large)
        with timed("spark-submit, all of it"):
            (counts,) = cluster.submit(*cluster.words("large/*", "results-large")).counts()
        check("large", folder / "results-large", [os.path.relpath(path, folder) for path in large], 0, counts)
        written = sorted(path.stat().st_mtime for path in (folder / "results-large").glob("part-*"))
        seconds = pandas.read_parquet(folder / "results-large")["seconds"]
        rate = loop(rig, large)
        spark = given.large / (written[-1] - written[0] + seconds.mean()) / CORES
        ratios.append(spark / rate)
        rates = f"loop {rate:.2f}, Spark {spark:.2f}, ratio {spark / rate:.2f}"
        say(f"large recordings of {size / 2**20:.1f} MB, a second a core: {rates}; load {os.getloadavg()[0]:.0f}")

    assert all(ratio >= RATIO for ratio in ratios), f"a core does less than {RATIO} of a loop's"


if __name__ == "__main__":
    main()
