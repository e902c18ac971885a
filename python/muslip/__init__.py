"""The mu-slip curve of tyres from recordings, by the engine of the command ``muslip``.

Examples
--------
>>> import muslip
>>> rig = muslip.Rig(radius_m=0.31, inertia_kg_m2=1.25, mass_kg=420.0, peak_friction=0.85, critical_slip=0.14)
>>> estimate = muslip.estimate(muslip.simulate(rig, seed=7), rig)
>>> abs(estimate.peak_friction.value - 0.85) < 0.05
True
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from . import _native
from ._errors import MuslipError
from ._peak import Peak
from ._results import (
    Channel,
    Consistency,
    Diagnosis,
    Estimate,
    Evidence,
    Finding,
    Fit,
    Frame,
    Mechanism,
    Parameter,
    Quantity,
    Samples,
    _frame,
    _write,
    diagnosis_of,
    estimate_of,
    fit_of,
)

if TYPE_CHECKING:
    import pandas
    import pyarrow

__version__ = _native.__version__
__all__ = [
    "Channel", "Consistency", "Diagnosis", "Estimate", "Estimator", "Evidence", "Finding", "Fit", "Frame",
    "Mechanism", "MuslipError", "Parameter", "Peak", "Quantity", "Recording", "Rig", "Samples", "channels", "diagnose",
    "estimate", "fit", "predict", "read", "simulate",
]  # fmt: skip

Path = str | os.PathLike[str]
Map = Path | Mapping[str, Any] | None
Progress = Callable[[float, str], object] | bool | None
Model = _native.Model

_CONTRACT = (
    "time_s", "wheel_speed_rad_s", "vehicle_speed_m_s", "drag_force_n", "normal_force_n", "brake_torque_nm",
    "brake_pressure_pa",
)  # fmt: skip


def _map(map: Map) -> tuple[bool, str] | None:
    if map is None:
        return None
    if isinstance(map, Mapping):
        return (False, json.dumps(map))
    return (True, os.fspath(map))


class Rig:
    """A rig: wheel, vehicle, brake, tyre and the noise of its channels.

    Parameters
    ----------
    tables : mapping, optional
        The tables of a rig file; keywords are laid over them.
    radius_m, inertia_kg_m2 : float
        Free-rolling radius (0.005 to 2 m) and moment of inertia of the wheel.
    mass_kg : float
        Translating mass that the braked tyre slows.
    coasting : bool
        Whether only this tyre's drag slows it.
    torque_per_pressure_nm_pa : float, optional
        Of the brake.
    peak_friction, critical_slip : float
        Where the tyre law starts.
    fixed : bool
        Whether the two are not to be refitted.
    noise : mapping, optional
        1-sigma of each channel, by its column.

    Raises
    ------
    MuslipError
        A value that is missing, not finite or not positive. Of the radius alone a rig is enough for estimates and fits.

    Examples
    --------
    >>> Rig(radius_m=0.31).radius_m
    0.31
    """

    _engine: _native.Rig

    def __init__(
        self,
        tables: Mapping[str, Any] | None = None,
        *,
        radius_m: float | None = None,
        inertia_kg_m2: float | None = None,
        mass_kg: float | None = None,
        coasting: bool | None = None,
        torque_per_pressure_nm_pa: float | None = None,
        peak_friction: float | None = None,
        critical_slip: float | None = None,
        fixed: bool | None = None,
        noise: Mapping[str, float] | None = None,
    ) -> None:
        whole: dict[str, dict[str, Any]] = {name: dict(table) for name, table in (tables or {}).items()}
        given: dict[str, dict[str, Any]] = {
            "wheel": {"radius_m": radius_m, "inertia_kg_m2": inertia_kg_m2},
            "vehicle": {"mass_kg": mass_kg, "coasting": coasting},
            "brake": {"torque_per_pressure_nm_pa": torque_per_pressure_nm_pa},
            "tyre": {"peak_friction": peak_friction, "critical_slip": critical_slip, "fixed": fixed},
            "noise": dict(noise or {}),
        }
        for name, table in given.items():
            said = {key: value for key, value in table.items() if value is not None}
            if said:
                whole.setdefault(name, {}).update(said)
        if set(whole) == {"wheel"} and set(whole["wheel"]) == {"radius_m"}:
            self._engine = _native.Rig.of_radius(whole["wheel"]["radius_m"])
            return
        if "vehicle" in whole:
            whole["vehicle"].setdefault("coasting", True)
        whole.setdefault("tyre", {}).setdefault("law", "rudd")
        numbers = {"radius_m", "inertia_kg_m2", "mass_kg", "torque_per_pressure_nm_pa", "peak_friction", "critical_slip"}
        for name, table in whole.items():
            for key, value in table.items():
                if (key in numbers or name == "noise") and not isinstance(value, bool):
                    number = float(value)
                    if not np.isfinite(number):
                        raise MuslipError(f"rig:1:1: {name}.{key} = {number}: must be finite and positive", "rig", 1, 1)
                    table[key] = number
        self._engine = _native.Rig.of_json(json.dumps(whole))

    @classmethod
    def from_toml(cls, path: Path) -> Rig:
        """Read a rig file."""
        return cls._of(_native.Rig.read(path))

    @classmethod
    def _of(cls, native: _native.Rig) -> Rig:
        rig = cls.__new__(cls)
        rig._engine = native
        return rig

    @property
    def radius_m(self) -> float:
        """Free-rolling radius in m."""
        return float(self.to_dict()["wheel"]["radius_m"])

    def to_toml(self, path: Path | None = None) -> str:
        """The text of the rig file, written to a path where one is given."""
        if path is not None:
            _write(path, self._engine.text)
        return self._engine.text

    def to_dict(self) -> dict[str, Any]:
        """The tables of the rig file."""
        tables: dict[str, Any] = json.loads(self._engine.json())
        return tables

    def __repr__(self) -> str:
        return f"Rig({self.to_dict()!r})"

    def __reduce__(self) -> tuple[Any, ...]:
        return (_rig_again, (self._engine.text, self._engine.path, self._engine.whole))


def _rig_again(text: str, path: str, whole: bool) -> Rig:
    if not whole:
        return Rig(radius_m=float(text.split("=")[1]))
    return Rig._of(_native.Rig.of_text(text, path))


RigLike = Rig | Path | Mapping[str, Any]


def _rig(rig: RigLike) -> _native.Rig:
    if isinstance(rig, Rig):
        return rig._engine
    if isinstance(rig, Mapping):
        return Rig(rig)._engine
    return _native.Rig.read(rig)


class Recording:
    """A recording in memory.

    Parameters
    ----------
    data : pandas or polars frame, pyarrow table, or mapping of names to arrays
        Columns of the contract (``time_s``, ``wheel_speed_rad_s``, ``vehicle_speed_m_s``, ``drag_force_n``,
        ``normal_force_n`` ...) as float64 are not copied; other numbers are converted, missing values are NaN.
    map : path or mapping, optional
        How other columns become those of the contract, as for files.
    name : str
        What stands for a file in errors and results.

    Raises
    ------
    MuslipError
        Columns of different lengths, a time that goes back, a column of the contract that holds no numbers.

    Examples
    --------
    >>> import numpy as np
    >>> time = np.linspace(0.0, 1.0, 5)
    >>> len(Recording({"time_s": time, "drag_force_n": 10.0 * time}))
    5
    """

    _engine: _native.Columns

    def __init__(self, data: Any, *, map: Map = None, name: str = "recording") -> None:
        columns = _columns_of(data)
        if map is not None or not any(column in _CONTRACT for column in columns):
            self._engine = _mapped(columns, map, name)
            return
        names, arrays = [], []
        for index, (column, values) in enumerate(columns.items()):
            array = _floats(values)
            if array is not None:
                names.append(str(column))
                arrays.append(array)
            elif column in _CONTRACT:
                message = f"{name}:1:{index + 1}: {column}: not numbers"
                raise MuslipError(message, name, 1, index + 1, str(column))
        self._engine = _native.Columns.of_arrays(name, names, arrays)

    @classmethod
    def _of(cls, native: _native.Columns) -> Recording:
        recording = cls.__new__(cls)
        recording._engine = native
        return recording

    @property
    def name(self) -> str:
        """The file, or what stands for one."""
        return self._engine.name

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return self._engine.names

    @property
    def notes(self) -> list[str]:
        """What was done to read it from a file of another format."""
        return self._engine.notes

    def __len__(self) -> int:
        return self._engine.rows

    def __repr__(self) -> str:
        return f"<muslip.Recording {self.name!r}: {len(self)} rows of {', '.join(self.columns)}>"

    def to_dict(self) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
        """The columns as arrays."""
        return {name: np.frombuffer(self._engine.column(index), dtype=np.float64) for index, name in enumerate(self.columns)}

    def to_pandas(self) -> pandas.DataFrame:
        """The columns as a pandas frame."""
        import pandas

        return pandas.DataFrame(self.to_dict())

    def to_arrow(self) -> pyarrow.Table:
        """The columns as a pyarrow table."""
        import pyarrow

        return pyarrow.table(self.to_dict())


def _columns_of(data: Any) -> dict[str, Any]:
    if isinstance(data, Mapping):
        return dict(data)
    if hasattr(data, "column_names"):  # pyarrow
        return {name: data.column(index) for index, name in enumerate(data.column_names)}
    if hasattr(data, "get_columns"):  # polars
        return {column.name: column for column in data.get_columns()}
    if hasattr(data, "columns") and hasattr(data, "iloc"):  # pandas
        return {str(name): data.iloc[:, index] for index, name in enumerate(data.columns)}
    kind = type(data).__name__
    raise MuslipError(f"error: {kind} is neither a path nor a pandas, polars or pyarrow frame nor a dict of arrays")


def _floats(values: Any) -> Any:
    """Values as float64, in place where they are that already; ``None`` where they are no numbers."""
    if hasattr(values, "combine_chunks"):  # pyarrow
        if values.num_chunks == 1:
            values = values.chunk(0)
        values = values.to_numpy(zero_copy_only=False) if not hasattr(values, "chunk") else values.to_numpy()
    elif hasattr(values, "iloc"):  # pandas
        kind = getattr(values.dtype, "kind", "O")
        if kind not in "fiub":
            return None
        values = (
            values.to_numpy()
            if kind == "f" and isinstance(values.dtype, np.dtype)
            else values.to_numpy(dtype=np.float64, na_value=np.nan)
        )
    elif hasattr(values, "to_numpy"):  # polars
        values = values.to_numpy()
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "fiub":
        return None
    return np.ascontiguousarray(array, dtype=np.float64)


def _mapped(columns: dict[str, Any], map: Map, name: str) -> _native.Columns:
    """By the reader of files, which knows maps, units and guesses."""
    try:
        import pyarrow
        from pyarrow import feather
    except ImportError:
        raise MuslipError("error: a frame with other columns than the contract's needs pyarrow: pip install pyarrow") from None
    table = pyarrow.table({str(column): _arrow(values) for column, values in columns.items()})
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "frame.feather")
        feather.write_feather(table, path, compression="uncompressed")
        return _native.Columns.read(path, _map(map), name)


def _arrow(values: Any) -> Any:
    array = _floats(values)
    if array is not None:
        return array
    return values.to_arrow() if hasattr(values, "to_arrow") else values


RecordingLike = Any


def _source(data: RecordingLike, name: str = "recording") -> Any:
    if isinstance(data, Recording):
        return data._engine
    if isinstance(data, (str, os.PathLike)):
        return data
    return Recording(data, name=name)._engine


def _sources(data: RecordingLike) -> list[Any]:
    if not isinstance(data, (list, tuple)):
        data = [data]
    sources: list[Any] = []
    for index, one in enumerate(data):
        if isinstance(one, Recording) and any(one is other for other in data[:index]):
            raise MuslipError(f"{one.name}:1:1: given twice", one.name, 1, 1)
        source = _source(one, f"recording{index + 1}")
        named = isinstance(source, _native.Columns)
        if named and source.name in {"recording", "simulated"} and len(data) > 1:
            source = source.named(f"{source.name}{index + 1}")
        sources.append(source)
    return sources


class _Bar:
    """Progress: a callback, or a bar of tqdm where that is there and ``progress=True``."""

    def __init__(self, progress: Progress, name: str) -> None:
        self.call: Callable[[float, str], object] | None = None
        self.bar: Any = None
        if callable(progress):
            self.call = progress
        elif progress:
            try:
                from tqdm.auto import tqdm
            except ImportError:
                return
            self.bar = tqdm(total=1.0, desc=name, bar_format="{desc} {percentage:3.0f}%|{bar}| {elapsed}")
            self.call = self._tell

    def _tell(self, share: float, step: str) -> None:
        self.bar.set_description(step, refresh=False)
        self.bar.update(share - self.bar.n)

    def __enter__(self) -> Callable[[float, str], object] | None:
        return self.call

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.close()


def channels(path: Path, map: Map = None) -> list[Channel]:
    """List the channels of a file: the fields of ``muslip channels --json``.

    Parameters
    ----------
    path : path
        MDF, TDMS, MAT, HDF5, Parquet, Feather or CSV.
    map : path or mapping, optional
        To see what it finds; without one, roles are guessed.

    Raises
    ------
    MuslipError
        Nothing of the file can be read.
    """
    listing = json.loads(_native.channels(path, _map(map)))
    return [Channel(**{"role": None, **one}) for one in listing["channels"]]


def read(path: Path, map: Map = None) -> Recording:
    """Read a recording of any supported format into memory.

    Parameters
    ----------
    path : path
        The file.
    map : path or mapping, optional
        Which channel is which column; without one it is guessed.

    Raises
    ------
    MuslipError
        With file, line and column.
    """
    return Recording._of(_native.Columns.read(path, _map(map)))


def estimate(
    recording: RecordingLike,
    rig: RigLike,
    *,
    map: Map = None,
    range: Literal["aircraft", "automotive"] | None = None,
    estimator: Literal["article", "efficient"] | None = None,
    model: Model | Path | None = None,
    trace: bool = True,
    progress: Progress = None,
) -> Estimate:
    """Estimate peak friction and the slip of the peak from one recording.

    Parameters
    ----------
    recording : Recording, path or frame
        One run.
    rig : Rig, path or mapping
        The radius alone is enough.
    map : path or mapping, optional
        Of the channels of a file.
    range : {"aircraft", "automotive"}, optional
        Tyres to start from; without it, found from the recording.
    estimator : {"article", "efficient"}, optional
        The filter; ``efficient`` without it.
    model : Model or path, optional
        Effects to compensate, from a diagnosis.
    trace : bool
        Whether the estimate after every sample is kept.
    progress : callable or bool, optional
        Called with share and step; ``True`` shows a bar of tqdm.

    Raises
    ------
    MuslipError
        The recording, the rig or the model cannot be used.

    Examples
    --------
    >>> rig = Rig(radius_m=0.31, inertia_kg_m2=1.25, mass_kg=420.0, peak_friction=0.85, critical_slip=0.14)
    >>> estimate(simulate(rig, seed=3), rig).estimator
    'efficient'
    """
    if model is not None and not isinstance(model, Model):
        model = Model.read(model)
    with _Bar(progress, "estimate") as told:
        native = _native.estimate(_source(recording), _rig(rig), _map(map), range, estimator, model, trace, told)
    return estimate_of(native)


def fit(
    recordings: RecordingLike,
    rig: RigLike,
    *,
    map: Map = None,
    max_iterations: int = 100,
    progress: Progress = None,
) -> Fit:
    """Fit the two-parameter law to one or several recordings at once.

    Parameters and errors are those of :func:`estimate`.
    """
    with _Bar(progress, "fit") as told:
        return fit_of(_native.fit(_sources(recordings), _rig(rig), _map(map), max_iterations, told))


def diagnose(
    recordings: RecordingLike,
    rig: RigLike,
    *,
    map: Map = None,
    out: Path | None = None,
    progress: Progress = None,
) -> Diagnosis:
    """Find what recordings show that the simulation lacks.

    Parameters
    ----------
    recordings : list of Recording, path or frame
        Runs of one rig.
    rig : Rig, path or mapping
        The whole rig.
    map : path or mapping, optional
        Of the channels of files.
    out : path, optional
        Folder for diagnosis.json, model.toml and report.html.
    progress : callable or bool, optional
        Called with share and step; ``True`` shows a bar of tqdm.

    Raises
    ------
    MuslipError
        A recording or the rig cannot be used, or ``out`` cannot be written.
    """
    with _Bar(progress, "diagnose") as told:
        return diagnosis_of(_native.diagnose(_sources(recordings), _rig(rig), _map(map), out, told))


def predict(
    recording: RecordingLike, rig: RigLike, model: Model | Path, *, map: Map = None, base: bool = False
) -> pandas.DataFrame:
    """Predict the drag reading of a recording from its other columns.

    Returns
    -------
    pandas.DataFrame
        ``time_s``, ``drag_force_n``, ``drag_force_sigma_n``, ``contact_force_n``, a row a row of the recording.
    """
    if not isinstance(model, Model):
        model = Model.read(model)
    return _frame(_native.predict(_source(recording), _rig(rig), model, _map(map), base)).to_pandas()


def simulate(
    rig: RigLike,
    *,
    seed: int = 1,
    law: str | None = None,
    speed_m_s: float | None = None,
    normal_force_n: float | None = None,
    applications: int = 3,
    duration_s: float = 4.0,
    rate_hz: float | None = None,
    noise: bool = True,
) -> Recording:
    """Simulate a run of a rig; the numbers are those of ``muslip simulate``.

    Parameters
    ----------
    rig : Rig, path or mapping
        The whole rig.
    seed : int
        Of the sensors' noise.
    law : str, optional
        ``rudd:MUP,SP``, ``burckhardt:SURFACE``, ``burckhardt:C1,C2,C3`` or ``magic-formula:B,C,D,E``.
    speed_m_s, normal_force_n : float, optional
        Speed at the start and load; what the rig makes sensible where they are not given.
    applications : int
        Applications of the brake.
    duration_s, rate_hz : float
        Length and rate of the recording.
    noise : bool
        Whether the sensors have the rig's noise.
    """
    return Recording._of(
        _native.simulate(_rig(rig), law, seed, speed_m_s, normal_force_n, applications, duration_s, rate_hz, noise)
    )


class Estimator:
    """The estimator, sample by sample.

    Examples
    --------
    >>> follower = Estimator(range="automotive")
    >>> follower.update(0.05, 0.5, 0.02)
    True
    >>> follower.peak.peak_friction > 0
    True
    """

    def __init__(
        self,
        range: Literal["aircraft", "automotive"] | None = None,
        estimator: Literal["article", "efficient"] | None = None,
    ) -> None:
        self._engine = _native.Estimator(range, estimator)

    def update(self, slip: float, friction: float, std: float) -> bool:
        """Correct the estimate with one measurement; whether it was taken."""
        return self._engine.update(slip, friction, std)

    def update_many(self, slips: Any, frictions: Any, stds: Any) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Correct it with one measurement after the other; whether each was taken. One ``std`` may serve all."""
        slips = np.ascontiguousarray(slips, dtype=np.float64)
        stds = np.ascontiguousarray(np.broadcast_to(np.asarray(stds, dtype=np.float64), slips.shape))
        frictions = np.ascontiguousarray(frictions, dtype=np.float64)
        return np.frombuffer(self._engine.update_many(slips, frictions, stds), dtype=np.bool_)

    @property
    def peak(self) -> Peak:
        """The peak of the curve as estimated now."""
        return Peak(*self._engine.peak())
