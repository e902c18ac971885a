"""The fleet: rows for whatever happens, a data set that can be gone on with, and what it says as a whole."""

from __future__ import annotations

import doctest
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pandas
import pyarrow.parquet
import pytest

sys.path.insert(0, os.path.dirname(__file__))
import fleets

import muslip
import muslip.fleet
from muslip.fleet import Counts, _child, _results, _storage, _work, diagnose, process, run, summary, to_delta


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    return fleets.rig(folder), fleets.small(folder / "runs", 40)


def without_times(out) -> bytes:
    frame = pandas.read_parquet(out).drop(columns="seconds").sort_values("path", ignore_index=True)
    return frame.to_json().encode()


def test_a_row_is_the_estimate_and_plain(made):
    rig, paths = made
    row = process(paths[0], rig=rig)
    result = muslip.estimate(paths[0], rig)
    assert list(row) == _results.RECORDINGS.names
    assert row["error"] is None and row["verdict"] == result.consistency.verdict and row["mechanisms"] is None
    assert (row["peak_friction"], row["peak_friction_std"]) == (result.peak_friction.value, result.peak_friction.std)
    assert (row["critical_slip"], row["critical_slip_std"]) == (result.critical_slip.value, result.critical_slip.std)
    assert (row["correlation"], row["samples"]) == (result.correlation, result.samples.used)
    assert row["version"] == muslip.__version__ and 0 < row["seconds"] < 10
    other = process(paths[0], rig=rig, range="aircraft")
    assert other["settings"] != row["settings"] and other["fingerprint"] == row["fingerprint"]


def test_of_two_tasks_at_one_part_the_slower_keeps_what_the_faster_added(made, tmp_path):
    rig, paths = made
    slower, faster = (_results.Results.made(str(tmp_path), _results.RECORDINGS, 1) for _ in range(2))
    rows = {path: process(path, rig) for path in map(os.fspath, paths[:2])}
    part = slower.part_of(os.fspath(paths[0]))
    assert slower.rows(part) == {}
    for task, path in zip((faster, slower), rows, strict=True):
        task.update(part, {path: rows[path]})
    assert slower.rows(part) == {row["path"]: row for row in rows.values()}


def test_what_goes_wrong_is_a_row_with_the_commands_line(made, tmp_path):
    rig, paths = made
    bad = tmp_path / "bad.csv"
    shutil.copy(paths[0], bad)
    fleets.corrupt(bad)
    with pytest.raises(muslip.MuslipError) as error:
        muslip.estimate(bad, rig)
    row = process(bad, rig)
    parts = (str(error.value), error.value.file, error.value.line, error.value.column, error.value.channel)
    assert tuple(row[name] for name in ("error", "error_file", "error_line", "error_column", "error_channel")) == parts
    assert row["fingerprint"] and row["peak_friction"] is None
    with pytest.raises(muslip.MuslipError) as error:
        muslip.estimate(tmp_path / "none.csv", rig)
    assert process(tmp_path / "none.csv", rig)["error"] == str(error.value)
    for path, of in ((tmp_path / "none.csv", rig), (tmp_path, rig), (paths[0], tmp_path / "none.toml"), (paths[0], None)):
        row = process(path, of)
        assert len(row["error"].splitlines()) == 1 and row["fingerprint"] is None, row
    for noise in (b"", b"\0" * 4096, os.urandom(4096), b"MDF     4.10    " + bytes(3000), b"ARROW1\0\0" + bytes(500)):
        bad.write_bytes(noise)
        assert process(bad, rig)["error"]
    row = process(fleets.endless(tmp_path), rig, timeout_s=0.5)
    assert row["error"] == "error: took longer than 0.5 s" and row["seconds"] < 5


def test_a_pool_leaves_a_row_each_and_goes_on(made, tmp_path):
    rig, paths = made
    out = tmp_path / "results"
    bad = tmp_path / "bad.csv"
    shutil.copy(paths[0], bad)
    fleets.corrupt(bad)
    asked = [*paths, str(bad), fleets.endless(tmp_path)]
    told = []
    counts = run(asked, out, rig=rig, timeout_s=1.0, progress=lambda share, step: told.append(share))
    assert counts == Counts(done=40, skipped=0, failed=2) and told == sorted(told) and told[-1] == 1.0
    frame = pandas.read_parquet(out)
    assert sorted(frame["path"]) == sorted(asked) and list(frame.columns) == _results.RECORDINGS.names
    assert frame["error"].notna().sum() == 2
    first = without_times(out)

    # Nothing but the one that could not even be hashed is tried again, and files are as they were.
    files = {path: path.read_bytes() for path in out.glob("part-*")}
    assert run(asked, out, rig=rig, timeout_s=1.0) == Counts(done=0, skipped=41, failed=1)
    changed = [path for path, content in files.items() if path.read_bytes() != content]
    assert len(changed) <= 1 and without_times(out) == first

    # What is missing, and only that.
    lost = sorted(files)[0]
    rows = len(pandas.read_parquet(lost))
    lost.unlink()
    (out / f"{_storage.TEMPORARY}part-000001.parquet.7").write_bytes(b"half")
    assert run(paths, out, rig=rig, timeout_s=1.0).done in (rows, rows - 1, rows - 2)
    assert run(asked, out, rig=rig, timeout_s=1.0).skipped >= 40 and without_times(out) == first
    assert not list(out.glob(f"{_storage.TEMPORARY}*"))

    # Another input, other settings, another version: worked out anew, in place.
    before = os.stat(paths[3])
    content = pathlib.Path(paths[3]).read_bytes()
    shutil.copy(paths[4], paths[3])
    os.utime(paths[3], ns=(before.st_atime_ns, before.st_mtime_ns))
    assert run(paths, out, rig=rig, timeout_s=1.0) == Counts(done=1, skipped=39, failed=0)
    pathlib.Path(paths[3]).write_bytes(content)
    assert run(paths, out, rig=rig, timeout_s=1.0, range="aircraft") == Counts(done=40, skipped=0, failed=0)
    assert run(paths, out, rig=rig, timeout_s=1.0) == Counts(done=40, skipped=0, failed=0)
    tables = {part: pyarrow.parquet.read_table(part) for part in out.glob("part-*")}
    part, table = next((part, table) for part, table in tables.items() if set(table["path"].to_pylist()) <= set(paths))
    old = table.set_column(table.column_names.index("version"), "version", [["0.0.1"] * len(table)])
    pyarrow.parquet.write_table(old, part)
    assert run(paths, out, rig=rig, timeout_s=1.0) == Counts(done=len(table), skipped=40 - len(table), failed=0)
    assert without_times(out) == first

    assert run(paths, out, rig=rig, timeout_s=1.0, resume=False) == Counts(done=40, skipped=0, failed=0)
    again = tmp_path / "again"
    run(asked, again, rig=rig, timeout_s=1.0, workers=1)
    assert without_times(again) == first


def test_a_run_that_is_killed_is_gone_on_with(made, tmp_path):
    rig, _ = made
    paths = fleets.small(tmp_path / "runs", 200, rate_hz=1000.0, duration_s=4.0)
    out = tmp_path / "results"
    script = f"from muslip.fleet import run; run({str(tmp_path / 'runs/*')!r}, {str(out)!r}, rig={str(rig)!r})"
    driver = subprocess.Popen([sys.executable, "-c", script])
    while len(list(out.glob("part-*"))) < 20:
        time.sleep(0.01)
        assert driver.poll() is None, "it was over before it could be killed"
    driver.kill()
    driver.wait()
    there = len(pandas.read_parquet(out))
    assert 0 < there < 200
    counts = run(paths, out, rig=rig)
    assert counts == Counts(done=200 - there, skipped=there, failed=0)
    assert sorted(pandas.read_parquet(out)["path"]) == sorted(paths)


def test_a_worker_that_is_killed_costs_nothing(made, tmp_path, monkeypatch):
    rig, _ = made
    paths = fleets.small(tmp_path / "runs", 60, rate_hz=1000.0, duration_s=4.0)
    children = []
    start = _child.Child._start
    monkeypatch.setattr(_child.Child, "_start", lambda self: children.append(start(self)) or children[-1])

    def kill() -> None:
        while not children:
            time.sleep(0.01)
        time.sleep(0.1)
        os.kill(children[0].pid, signal.SIGKILL)

    thread = threading.Thread(target=kill)
    thread.start()
    counts = run(paths, tmp_path / "results", rig=rig, workers=2)
    thread.join()
    assert counts == Counts(done=60, skipped=0, failed=0) and len(children) == 3


def test_a_child_ends_with_what_hangs_or_aborts_and_another_takes_over():
    child = _child.Child()
    assert child.call(max, 1, 2) == 2
    with pytest.raises(_child.Died, match="signal 6"):
        child.call(os.abort)
    pid = child.call(os.getpid)
    with pytest.raises(_child.TooLong):
        child.call(time.sleep, 60, timeout_s=0.1)
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
    assert child.call(os.getpid, timeout_s=10.0) != pid
    child.close()


def test_many_at_once_are_answered_in_order_up_to_the_one_that_fails(monkeypatch):
    child = _child.Child()
    assert list(child.each(fleets.squared_or_worse, [(value,) for value in range(1000)])) == [
        value * value for value in range(1000)
    ]
    for worse, error in ((-1, _child.Died), (-2, _child.TooLong)):
        got = []
        with pytest.raises(error):
            for result in child.each(fleets.squared_or_worse, [(2,), (3,), (worse,), (4,)], timeout_s=0.5):
                got.append(result)
        # Of a process that has died, what was on its way is lost; who waits long enough has all that was ready.
        assert got == [4, 9] if error is _child.TooLong else got in ([], [4], [4, 9])
    child.close()


def test_one_that_aborts_among_many_costs_its_row_alone(made, tmp_path, monkeypatch):
    rig, paths = made
    monkeypatch.setattr(_work, "_worked", fleets.aborting_on_the_fourth)
    monkeypatch.setattr(_results, "_FEWEST_PARTS", 1)
    assert run(paths, tmp_path / "results", rig=rig, workers=1) == Counts(done=39, skipped=0, failed=1)
    frame = pandas.read_parquet(tmp_path / "results").set_index("path")
    assert frame.loc[paths[3], "error"] == "error: its process died twice: signal 6"


def test_rigs_and_maps_are_joined_by_a_key(made, tmp_path):
    rig, paths = made
    heavy = muslip.Rig(**{**fleets.RIG, "radius_m": 0.4})
    runs = paths[:6]
    table = pandas.DataFrame({"path": runs, "rig": ["a", "b", "c"] * 2, "tyre": "summer", "day": pandas.Timestamp("2026-03-01")})
    counts = run(table, tmp_path / "keyed", rig={"a": rig, "b": heavy})
    assert counts == Counts(done=4, skipped=0, failed=2)
    frame = pandas.read_parquet(tmp_path / "keyed").set_index("path")
    for path, key in zip(runs, table["rig"], strict=True):
        row = frame.loc[path]
        assert (row["rig"], row["tyre"], row["day"]) == (key, "summer", "2026-03-01")
        if key == "c":
            assert row["error"] == "error: no rig 'c' among those given"
        else:
            assert row["peak_friction"] == process(path, {"a": rig, "b": heavy}[key])["peak_friction"]
    assert frame["settings"].nunique() == 3

    # A label alone is no reason to work anything out, but is brought up to date.
    assert run(table.assign(tyre="winter"), tmp_path / "keyed", rig={"a": rig, "b": heavy}).skipped == 4
    assert set(pandas.read_parquet(tmp_path / "keyed")["tyre"]) == {"winter"}

    # Of files: the table has them.
    files = pandas.DataFrame({"path": runs, "rig": [str(rig)] * 5 + [str(tmp_path / "none.toml")]})
    assert run(files, tmp_path / "files") == Counts(done=5, skipped=0, failed=1)

    columns = muslip.read(runs[0]).to_pandas().rename(columns={"drag_force_n": "fx"})
    columns.to_csv(tmp_path / "other.csv", index=False)
    names = {name: name for name in columns.columns if name != "fx"} | {"drag_force_n": "fx"}
    units = dict(time_s="s", wheel_speed_rad_s="rad/s", vehicle_speed_m_s="m/s", drag_force_n="N", normal_force_n="N",
                 brake_pressure_pa="Pa", brake_torque_nm="Nm")  # fmt: skip
    map = "".join(f'[channels.{role}]\nname = "{name}"\nunit = "{units[role]}"\n' for role, name in names.items())
    (tmp_path / "map.toml").write_text(map)
    other = str(tmp_path / "other.csv")
    expected = process(runs[0], rig)["peak_friction"]
    assert process(other, rig, tmp_path / "map.toml")["peak_friction"] == expected
    table = pandas.DataFrame({"path": [other], "map": ["m"]})
    assert run(table, tmp_path / "mapped", rig=rig, map={"m": tmp_path / "map.toml"}) == Counts(1, 0, 0)
    with pytest.raises(muslip.MuslipError):
        run([other], tmp_path / "mapped2", rig=rig, map=tmp_path / "none.toml")


def test_what_is_asked_wrongly_is_said_before_anything_runs(made, tmp_path):
    rig, paths = made
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign/notes.txt").write_text("")
    twice = pandas.DataFrame({"path": [paths[0]] * 2, "rig": ["a", "b"]})
    for ask in (
        lambda: run(str(tmp_path / "*.mf4"), tmp_path / "out", rig=rig),
        lambda: run(paths, tmp_path / "out", rig=tmp_path / "none.toml"),
        lambda: run(paths, tmp_path / "foreign", rig=rig),
        lambda: run(paths, tmp_path / "out", engine="abacus", rig=rig),
        lambda: run(pandas.DataFrame({"file": paths}), tmp_path / "out", rig=rig),
        lambda: run(twice, tmp_path / "out"),
        lambda: diagnose(paths, tmp_path / "out", by="colour", rig=rig),
        lambda: diagnose(paths, tmp_path / "out", by="tyre", rig=rig),
        lambda: summary(tmp_path),
    ):
        with pytest.raises(muslip.MuslipError) as error:
            ask()
        assert len(str(error.value).splitlines()) == 1


def test_groups_are_diagnosed_together(made, tmp_path):
    rig, _ = made
    paths = fleets.small(tmp_path / "runs", 8, rate_hz=250.0, duration_s=4.0)
    table = pandas.DataFrame({"path": paths, "tyre": ["a", "b"] * 4, "day": [f"2026-03-0{1 + i % 3}" for i in range(8)]})
    out = tmp_path / "diagnoses"
    assert diagnose(table, out, by="tyre", rig=rig, most=3) == Counts(done=2, skipped=0, failed=0)
    frame = pandas.read_parquet(out).set_index("group")
    used = [row.path for row in table[table["tyre"] == "a"].sort_values(["day", "path"]).itertuples()]
    used = [used[0], used[2], used[3]]
    assert frame.loc["a", "recordings"] == 3
    alone = muslip.diagnose(used, rig)
    assert frame.loc["a", "json"] == alone.to_json() and frame.loc["a", "verdict"] == alone.verdict
    assert [one["id"] for one in frame.loc["a", "mechanisms"]] == [one.id for one in alone.mechanisms]
    assert diagnose(table, out, by="tyre", rig=rig, most=3) == Counts(done=0, skipped=2, failed=0)
    fleets.corrupt(used[1])
    assert diagnose(table, out, by="tyre", rig=rig, most=3) == Counts(done=0, skipped=1, failed=1)
    with pytest.raises(muslip.MuslipError):
        run(paths, out, rig=rig)
    rigs = {"x": rig, "y": muslip.Rig(**{**fleets.RIG, "radius_m": 0.4})}
    mixed = diagnose(table.assign(rig=["x", "x", "y", "y"] * 2), tmp_path / "mixed", by="tyre", rig=rigs)
    assert mixed == Counts(done=0, skipped=0, failed=2)
    single = process(paths[7], rig, diagnose=True)
    assert single["diagnosis"] == muslip.diagnose(paths[7], rig).verdict and single["mechanisms"] is not None


@pytest.mark.parametrize("by", ["fsspec", "pyarrow"])
def test_storages_are_read_and_written(made, tmp_path, monkeypatch, by):
    rig, paths = made
    expected = process(paths[0], rig)
    if by == "fsspec":
        import fsspec

        memory = fsspec.filesystem("memory")
        memory.put(os.path.dirname(paths[0]), "/fleet/runs", recursive=True)
        assert _storage.found("memory://fleet/runs/*.csv")[0] == f"memory:///fleet/runs/{os.path.basename(paths[0])}"
        assert len(_storage.found("memory://fleet/runs")) == 40
        row = process(f"memory://fleet/runs/{os.path.basename(paths[0])}", rig)
        out = "memory://fleet/results"
    else:
        monkeypatch.setattr(_storage, "_fsspec", lambda path: None)
        (tmp_path / "results").mkdir()
        row = process(pathlib.Path(paths[0]).as_uri(), rig)
        out = (tmp_path / "results").as_uri()
    assert (row["peak_friction"], row["fingerprint"]) == (expected["peak_friction"], expected["fingerprint"])
    missing = process(("memory://fleet/" if by == "fsspec" else tmp_path.as_uri() + "/") + "none.csv", rig)
    assert missing["error"].endswith("none.csv:1:1: cannot be read: no such file or directory")
    assert run(paths[:10], out, rig=rig) == Counts(done=10, skipped=0, failed=0)
    assert run(paths[:10], out, rig=rig) == Counts(done=0, skipped=10, failed=0)


def test_a_delta_table_has_the_rows_and_a_version_more_only_where_they_change(made, tmp_path):
    import deltalake

    rig, paths = made
    out, table = tmp_path / "results", tmp_path / "table"
    run(paths[:10], out, rig=rig)
    assert [to_delta(out, table), to_delta(out, table)] == [0, 0]
    run(paths, out, rig=rig)
    command = [sys.executable, "-m", "muslip.fleet", "delta", out, "--table", table]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "version 1\n"
    assert to_delta(out, table) == 1
    for version, rows in ((0, 10), (1, 40)):
        there = pyarrow.table(deltalake.DeltaTable(str(table), version=version).to_pyarrow_table())
        assert sorted(there["path"].to_pylist()) == sorted(paths[:rows])
    expected = pandas.read_parquet(out).sort_values("path", ignore_index=True)
    found = there.to_pandas().sort_values("path", ignore_index=True)
    pandas.testing.assert_frame_equal(found, expected[found.columns])
    deltalake.write_deltalake(str(tmp_path / "foreign"), pyarrow.table({"path": ["a"]}))
    for ask in (lambda: to_delta(tmp_path, table), lambda: to_delta(out, tmp_path / "foreign")):
        with pytest.raises(muslip.MuslipError) as error:
            ask()
        assert len(str(error.value).splitlines()) == 1


def rows_of(count: int, seed: int = 1) -> pandas.DataFrame:
    """Estimates of a fleet whose scatter is known: rigs 0.01, tyres 0.05, tracks 0.02, recordings 0.015 and their own 0.01."""
    noise = np.random.default_rng(seed)
    rigs, tyres, tracks = noise.normal(0, 0.01, 15), noise.normal(0, 0.05, 8), noise.normal(0, 0.02, 6)
    rig, tyre, track, day = (noise.integers(0, most, count) for most in (15, 8, 6, 60))
    peak = 0.8 + rigs[rig] + tyres[tyre] + tracks[track] + noise.normal(0, 0.015, count) + noise.normal(0, 0.01, count)
    # One rig wears its load cell out.
    peak = np.where(rig == 7, peak + 0.0005 * day, peak)
    days = pandas.Timestamp("2026-01-01") + pandas.to_timedelta(day, unit="D")
    return pandas.DataFrame({
        "path": [f"runs/{index:06}.mf4" for index in range(count)], "fingerprint": "0", "version": "0", "settings": "0",
        "verdict": "consistent", "peak_friction": peak, "peak_friction_std": 0.01,
        "critical_slip": noise.normal(0.14, 0.01, count), "critical_slip_std": 0.01, "correlation": 0.3, "samples": 400,
        "mechanisms": [[{"id": "force_delay", "confidence": 0.9}] if index % 4 == 0 else [] for index in range(count)],
        "error": None, "error_file": None, "error_line": None, "error_column": None, "error_channel": None, "seconds": 0.01,
        "diagnosis": None, "rig": [f"rig-{one}" for one in rig], "tyre": [f"tyre-{one}" for one in tyre],
        "track": [f"track-{one}" for one in track], "day": days.strftime("%Y-%m-%d"),
    })  # fmt: skip


def written(frame: pandas.DataFrame, out: pathlib.Path) -> pathlib.Path:
    out.mkdir()
    table = pyarrow.Table.from_pylist(frame.to_dict("records"), _results.RECORDINGS)
    pyarrow.parquet.write_table(table, out / "part-000000.parquet")
    return out


def test_the_summary_finds_what_was_put_in(tmp_path):
    frame = rows_of(20_000)
    frame.loc[100, "peak_friction"] += 0.5
    frame.loc[200, ["peak_friction", "peak_friction_std", "critical_slip", "critical_slip_std", "error"]] = [None] * 4 + [
        "a.csv:6:2: torn"
    ]
    found = summary(written(frame, tmp_path / "results"))
    assert (found.recordings, found.estimated, found.errors) == (20_000, 19_999, {"torn": 1})
    by_name = {one.name: one for one in found.factors if one.quantity == "peak_friction"}
    sizes = {"rig": 0.01, "tyre": 0.05, "track": 0.02}
    for name, size in sizes.items():
        # Of so few levels a scatter is known to a factor of two at the most.
        assert size / 2 < by_name[name].crossed < 2 * size, by_name[name]
        assert by_name[name].between < 3 * size
        # Of these tyres and tracks: their own effects are part of a rig's mean.
        assert abs(by_name[name].mean.value - frame["peak_friction"].mean()) < 4 * by_name[name].mean.std
    drifting = [one for one in found.drifts if one.drifts]
    assert [one.rig for one in drifting] == ["rig-7"]
    assert abs(drifting[0].per_day.value - 0.0005) < 4 * drifting[0].per_day.std
    assert found.outliers[0].path == "runs/000100.mf4" and found.outliers[0].sigmas > 20
    share = found.mechanisms[0]
    assert share.mechanism == "force_delay" and share.low < 0.25 < share.high and share.confidence == pytest.approx(0.9)
    found.report(tmp_path / "fleet.html")
    page = (tmp_path / "fleet.html").read_text()
    assert "rig-7" in page and "force_delay" in page and "1 rig drifts" in page and "torn" in page
    assert "Infinity" not in page.split('id="figures"')[1].split("</script>")[0]


def test_a_quiet_fleet_of_one_rig_has_a_summary(made, tmp_path):
    rig, paths = made
    run(paths, tmp_path / "results", rig=rig)
    found = summary(tmp_path / "results")
    assert found.factors == () and found.drifts == () and found.mechanisms == ()
    assert abs(found.peak_friction.value - 0.85) < 5 * found.peak_friction.std
    found.report(tmp_path / "fleet.html")


def test_the_command_does_the_same(made, tmp_path):
    rig, paths = made
    command = [sys.executable, "-m", "muslip.fleet"]
    asked = [*command, "run", os.path.join(os.path.dirname(paths[0]), "*"), "--rig", rig, "--out", tmp_path / "results"]
    for printed in ("done 40, skipped 0, failed 0\n", "done 0, skipped 40, failed 0\n"):
        assert subprocess.run(asked, capture_output=True, text=True, check=True).stdout == printed
    page = [*command, "summary", tmp_path / "results", "--report", tmp_path / "fleet.html"]
    subprocess.run(page, check=True)
    assert (tmp_path / "fleet.html").exists()
    wrong = subprocess.run([*command, "run", tmp_path / "none*", "--out", tmp_path / "x"], capture_output=True, text=True)
    assert wrong.returncode == 2 and len(wrong.stderr.splitlines()) == 1


def test_examples_of_the_docstrings():
    tried = doctest.testmod(muslip.fleet)
    assert tried.attempted > 3 and tried.failed == 0
