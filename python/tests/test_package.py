"""The package against the command, and against what Python promises."""

from __future__ import annotations

import doctest
import json
import os
import pathlib
import pickle
import resource
import shutil
import signal
import subprocess
import threading
import time

import numpy as np
import pandas
import polars
import pyarrow
import pytest

import muslip

COMMAND = os.environ.get("MUSLIP_COMMAND")

RIG = dict(
    radius_m=0.31, inertia_kg_m2=1.25, mass_kg=420.0, torque_per_pressure_nm_pa=3.2e-4, peak_friction=0.85,
    critical_slip=0.14, noise={"drag_force_n": 90.0, "wheel_speed_rad_s": 0.15},
)  # fmt: skip


def command(*arguments: object) -> str:
    assert COMMAND, "MUSLIP_COMMAND must name the command to compare with"
    done = subprocess.run([COMMAND, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def complaint(*arguments: object) -> str:
    assert COMMAND, "MUSLIP_COMMAND must name the command to compare with"
    done = subprocess.run([COMMAND, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 2, done
    return done.stderr.strip()


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    rig = folder / "rig.toml"
    muslip.Rig(**RIG).to_toml(rig)
    runs = []
    for seed in range(1, 4):
        path = folder / f"run{seed}.csv"
        command("simulate", "--rig", rig, "--seed", seed, "--out", path)
        runs.append(path)
    return rig, runs


def test_json_is_the_commands_for_a_path_and_for_memory(files):
    rig, runs = files
    printed = command("estimate", "--rig", rig, "--json", runs[0])
    for recording in (runs[0], muslip.read(runs[0])):
        result = muslip.estimate(recording, rig)
        assert result.to_json() + "\n" == printed
        assert result.to_dict() == json.loads(printed)
    printed = command("fit", "--rig", rig, "--json", *runs)
    assert muslip.fit(runs, rig).to_json() + "\n" == printed
    assert muslip.fit([muslip.read(run) for run in runs], rig).to_json() + "\n" == printed


def test_a_diagnosis_writes_the_commands_files(files, tmp_path):
    rig, runs = files
    printed = command("diagnose", "--rig", rig, "--out", tmp_path / "command", "--json", *runs)
    told = []
    result = muslip.diagnose(runs, rig, out=tmp_path / "python", progress=lambda share, step: told.append(share))
    assert result.to_json() == printed
    assert told and told == sorted(told)
    for name in ("diagnosis.json", "model.toml"):
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "command" / name).read_bytes()
    assert result.verdict in result._repr_html_()
    command("predict", "--rig", rig, "--model", tmp_path / "command/model.toml", "--out", tmp_path / "p.csv", runs[0])
    rows = np.genfromtxt(tmp_path / "p.csv", delimiter=",", names=True)
    frame = muslip.predict(runs[0], rig, result.model)
    for name in frame.columns:
        assert np.array_equal(frame[name], rows[name])


def test_channels_and_simulation_are_the_commands(files):
    rig, runs = files
    listed = json.loads(command("channels", "--json", runs[0]))["channels"]
    assert [channel.name for channel in muslip.channels(runs[0])] == [one["name"] for one in listed]
    simulated = muslip.simulate(rig, seed=2).to_dict()
    for name, values in muslip.read(runs[1]).to_dict().items():
        assert np.array_equal(simulated[name], values), name


def test_errors_are_the_commands_line_with_its_parts(files, tmp_path):
    rig, runs = files
    bad = tmp_path / "bad.csv"
    lines = runs[0].read_text().splitlines()
    lines[5] = lines[5].replace(",", ",x", 1)
    bad.write_text("\n".join(lines))
    with pytest.raises(muslip.MuslipError) as error:
        muslip.estimate(bad, rig)
    assert str(error.value) == complaint("estimate", "--rig", rig, bad)
    assert (error.value.file, error.value.line, error.value.channel) == (str(bad), 6, "wheel_speed_rad_s")
    for make in (
        lambda: muslip.estimate(tmp_path / "none.csv", rig),
        lambda: muslip.estimate(runs[0], tmp_path / "none.toml"),
        lambda: muslip.diagnose([runs[0], runs[0]], rig),
        lambda: muslip.diagnose(runs, muslip.Rig(radius_m=0.31)),
        lambda: muslip.Rig(radius_m=310.0),
        lambda: muslip.estimate(runs[0], rig, range="bicycle"),
        lambda: muslip.Recording({"time_s": np.array([0.0, 2.0, 1.0])}),
        lambda: muslip.Recording({"time_s": np.zeros(0)}),
        lambda: muslip.estimate(3, rig),
        lambda: muslip.Estimator().update(float("nan"), 0.1, 0.1),
    ):
        with pytest.raises(muslip.MuslipError) as error:
            make()
        assert len(str(error.value).splitlines()) == 1


def test_columns_are_read_where_they_lie(files):
    rig, runs = files
    columns = {name: values.copy() for name, values in muslip.read(runs[0]).to_dict().items()}
    expected = muslip.estimate(muslip.Recording(columns), rig).to_dict()
    frame = pandas.DataFrame(columns, copy=False)
    table = pyarrow.table(columns)
    places = {
        "dict": (columns, [values.ctypes.data for values in columns.values()]),
        "pandas": (frame, [frame[name].to_numpy().ctypes.data for name in columns]),
        "pyarrow": (table, [column.chunk(0).buffers()[1].address for column in table.columns]),
        "polars": (polars.from_arrow(table), None),
    }
    for name, (data, addresses) in places.items():
        recording = muslip.Recording(data)
        if addresses is None:
            addresses = [column.to_numpy(allow_copy=False).ctypes.data for column in data.get_columns()]
        assert [recording._engine.address(index) for index in range(len(addresses))] == addresses, name
        assert muslip.estimate(data, rig).to_dict() == expected, name


def test_a_map_names_the_columns_of_a_frame(files):
    rig, runs = files
    columns = muslip.read(runs[0]).to_dict()
    other = {"t": columns["time_s"], "n": columns["wheel_speed_rad_s"], "v": columns["vehicle_speed_m_s"],
             "fx": columns["drag_force_n"], "fz": columns["normal_force_n"]}  # fmt: skip
    roles = dict(time_s=("t", "s"), wheel_speed_rad_s=("n", "rad/s"), vehicle_speed_m_s=("v", "m/s"),
                 drag_force_n=("fx", "N"), normal_force_n=("fz", "N"))  # fmt: skip
    map = {"channels": {role: {"name": name, "unit": unit} for role, (name, unit) in roles.items()}}
    mapped = muslip.estimate(muslip.Recording(other, map=map), rig)
    assert mapped.peak_friction == muslip.estimate(runs[0], rig).peak_friction


def test_the_filter_in_one_call_is_the_filter_step_by_step():
    slips = np.linspace(0.01, 0.6, 200)
    frictions = 2 * 0.9 * slips * 0.12 / (0.12**2 + slips**2)
    one, many = muslip.Estimator(range="automotive"), muslip.Estimator(range="automotive")
    taken = [one.update(slip, friction, 0.02) for slip, friction in zip(slips, frictions, strict=True)]
    assert many.update_many(slips, frictions, 0.02).tolist() == taken
    assert many.peak == one.peak and abs(one.peak.peak_friction - 0.9) < 0.02


def test_results_are_frozen_pickled_drawn_and_reported(files, tmp_path):
    rig, runs = files
    result = muslip.estimate(runs[0], rig)
    with pytest.raises(AttributeError):
        result.correlation = 0.0
    assert pickle.loads(pickle.dumps(result)) == result
    assert len(result.trace) == result.samples.used and "<svg" in result._repr_html_()
    result.report(tmp_path / "out.html")
    assert "<html" in (tmp_path / "out.html").read_text()
    pickled = pickle.loads(pickle.dumps(muslip.Rig.from_toml(rig)))
    assert pickled.to_toml() == rig.read_text()


def test_an_interrupt_ends_a_diagnosis_within_a_second(files):
    rig, _ = files
    runs = [muslip.simulate(rig, seed=seed, duration_s=60.0, law="burckhardt:wet-asphalt") for seed in range(6)]
    sent = []

    def interrupt() -> None:
        time.sleep(0.7)
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    # Whoever starts the tests in the background has the signal ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        thread.start()
        with pytest.raises(KeyboardInterrupt):
            muslip.diagnose(runs, rig)
        assert time.monotonic() - sent[0] < 1.0
    finally:
        thread.join()
        signal.signal(signal.SIGINT, before)
    # Its work ends at its next report. The tests that follow count processor time: not beside it.
    deadline = time.monotonic() + 60.0
    while _works():
        assert time.monotonic() < deadline, "the work of an interrupted diagnosis goes on"


def _works() -> bool:
    """Whether this process computes while nothing is asked of it."""
    before = time.process_time()
    time.sleep(0.2)
    return time.process_time() - before > 0.02


def test_no_panic_crosses():
    for words in ("put in by a test", "a second time"):
        with pytest.raises(muslip.MuslipError) as error:
            muslip._native.panics(words)
        assert str(error.value) == f"error: internal, please report it: {words}"
        assert isinstance(error.value, Exception)


def test_a_call_adds_less_than_a_twentieth_to_the_engine(files, tmp_path):
    rig, _ = files
    run = tmp_path / "long.csv"
    command("simulate", "--rig", rig, "--seed", 1, "--duration", 60, "--rate-hz", 1000, "--out", run)
    calls, commands = [], []

    def commanded() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    for _ in range(8):
        # Time of the processor, so that whatever else runs is not counted.
        before = time.process_time()
        muslip.estimate(run, rig, trace=False)
        calls.append(time.process_time() - before)
        before = commanded()
        command("estimate", "--rig", rig, "--json", run)
        commands.append(commanded() - before)
    print(f"a call {min(calls):.4f} s, the command {min(commands):.4f} s")
    assert min(calls) < 1.05 * min(commands)


def test_the_readmes_lines_run(files, tmp_path, monkeypatch, capsys):
    rig, runs = files
    shutil.copy(rig, tmp_path / "rig.toml")
    shutil.copy(runs[0], tmp_path / "run.csv")
    monkeypatch.chdir(tmp_path)
    for name in ("README.md", "python/README.md"):
        text = (pathlib.Path(__file__).parents[2] / name).read_text()
        lines = text.split("```python\n", 1)[1].split("```", 1)[0]
        exec(lines, {})
        peak = muslip.estimate("run.csv", "rig.toml").peak_friction
        assert capsys.readouterr().out == f"{peak.value} +- {peak.std}\n", name


def test_the_tutorial_runs(tmp_path):
    import nbclient
    import nbformat

    notebook = nbformat.read(pathlib.Path(__file__).parents[1] / "tutorial.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert any("<svg" in output.get("data", {}).get("text/html", "") for output in shown)
    assert any("image/png" in output.get("data", {}) for output in shown)


def test_examples_of_the_docstrings():
    tried = doctest.testmod(muslip)
    assert tried.attempted > 5 and tried.failed == 0
