"""Results: frozen dataclasses that mirror the JSON of the command."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from . import _native
from ._errors import MuslipError

if TYPE_CHECKING:
    import pandas

T = TypeVar("T")
_Object = dict[str, Any]


def _made(kind: type[T], of: _Object) -> T:
    """A dataclass of a JSON object; keys that it does not have stay in the JSON."""
    return kind(**{f.name: of.get(f.name) for f in fields(kind)})  # type: ignore[arg-type]


def _many(kind: type[T], of: list[_Object] | None) -> tuple[T, ...]:
    return tuple(_made(kind, one) for one in of or [])


def _write(path: str | os.PathLike[str], text: str) -> None:
    path = Path(path)
    part = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        reason = (error.strerror or str(error)).lower()
        raise MuslipError(f"{path}:1:1: cannot be written: {reason}", str(path), 1, 1) from None


@dataclass(frozen=True)
class Quantity:
    """A value with its standard deviation."""

    value: float
    std: float

    def __str__(self) -> str:
        return f"{self.value:.4g} ± {self.std:.2g}"


@dataclass(frozen=True)
class Consistency:
    """Whether an estimator believes itself no more than it should."""

    mean_nis: float
    nis_low: float
    nis_high: float
    whiteness_p: float | None
    verdict: str


@dataclass(frozen=True)
class Samples:
    """How many samples were used and skipped."""

    used: int
    skipped: int


@dataclass(frozen=True)
class Frame:
    """Columns of float64 under their names; an array each, by ``frame["name"]``."""

    columns: dict[str, np.ndarray[Any, np.dtype[np.float64]]] = field(repr=False)

    def __getitem__(self, name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
        return self.columns[name]

    def __len__(self) -> int:
        return next((len(column) for column in self.columns.values()), 0)

    def to_pandas(self) -> pandas.DataFrame:
        """The columns as a pandas frame."""
        import pandas

        return pandas.DataFrame(self.columns)


def _frame(columns: list[tuple[str, bytes]]) -> Frame:
    return Frame({name: np.frombuffer(values, dtype=np.float64) for name, values in columns})


@dataclass(frozen=True)
class _Result:
    """What all results share: the text of the command's JSON."""

    _json: str = field(repr=False)

    def to_json(self) -> str:
        """The JSON as the command prints it."""
        return self._json

    def to_dict(self) -> _Object:
        """The JSON as plain values, key for key and bit for bit."""
        result: _Object = json.loads(self._json)
        return result


def _curve(peak: float, slip: float, slips: Any) -> Any:
    return 2.0 * peak * slips * slip / (slip * slip + slips * slips)


def _band(peak: Quantity, slip: Quantity, correlation: float, slips: Any) -> tuple[Any, Any]:
    """The curve and its 1-sigma, to first order."""
    mu = _curve(peak.value, slip.value, slips)
    by_peak = _curve(1.0, slip.value, slips)
    squares = slip.value**2 + slips**2
    by_slip = peak.value * 2.0 * slips * (slips**2 - slip.value**2) / squares**2
    variance = (by_peak * peak.std) ** 2 + (by_slip * slip.std) ** 2
    variance += 2.0 * correlation * by_peak * by_slip * peak.std * slip.std
    return mu, np.sqrt(np.maximum(variance, 0.0))


def _svg(peak: Quantity, slip: Quantity, correlation: float) -> str:
    slips = np.linspace(0.0, 1.0, 101)
    mu, sigma = _band(peak, slip, correlation, slips)
    top = max(float(np.max(mu + sigma)) * 1.05, 1e-9)

    def points(xs: Any, ys: Any) -> str:
        return " ".join(f"{30 + 360 * x:.1f},{190 - 170 * y / top:.1f}" for x, y in zip(xs, ys, strict=True))

    band = points(np.r_[slips, slips[::-1]], np.r_[mu + sigma, (mu - sigma)[::-1]])
    return (
        '<svg viewBox="0 0 400 215" width="400" role="img" aria-label="friction against slip" '
        'font-family="sans-serif" font-size="11"><path d="M30 15V190H390" fill="none" stroke="#888"/>'
        f'<polygon points="{band}" fill="#4878a8" opacity="0.25"/>'
        f'<polyline points="{points(slips, mu)}" fill="none" stroke="#2a5a8a" stroke-width="2"/>'
        '<text x="200" y="208">slip</text>'
        f'<text x="2" y="12" fill="#666">friction, to {top:.2f}; band: 1-sigma</text></svg>'
    )


def _plot_curve(result: Estimate | Fit, ax: Any, points: tuple[Any, Any] | None) -> Any:
    from matplotlib import pyplot

    if ax is None:
        _, ax = pyplot.subplots()
    slips = np.linspace(0.0, 1.0, 201)
    mu, sigma = _band(result.peak_friction, result.critical_slip, result.correlation, slips)
    if points is not None:
        ax.plot(*points, ".", color="0.6", markersize=2, label="measured")
    ax.fill_between(slips, mu - sigma, mu + sigma, alpha=0.3, label="1-sigma")
    ax.plot(slips, mu, label="curve")
    ax.set(xlabel="slip", ylabel="friction", xlim=(0, 1))
    ax.legend()
    return ax


@dataclass(frozen=True)
class Estimate(_Result):
    """What ``muslip estimate`` prints, as attributes."""

    estimator: str
    peak_friction: Quantity
    critical_slip: Quantity
    correlation: float
    samples: Samples
    consistency: Consistency
    _engine: _native.Estimate | None = field(repr=False, compare=False, default=None)

    @property
    def trace(self) -> Frame:
        """The estimate after every used sample; empty where it was asked for without."""
        return _frame(self._kept().trace())

    def _kept(self) -> _native.Estimate:
        if self._engine is None:
            raise MuslipError("error: an estimate that was pickled has no trace and no report")
        return self._engine

    def report(self, path: str | os.PathLike[str]) -> None:
        """Write the page of ``muslip estimate --report``."""
        _write(path, self._kept().report_html())

    def plot(self, ax: Any = None) -> Any:
        """Draw the curve with its band by matplotlib; answers with the axes."""
        points = None
        if self._engine is not None:
            trace = self.trace
            points = (trace["slip"], trace["friction"])
        return _plot_curve(self, ax, points)

    def _repr_html_(self) -> str:
        return (
            f"<p><b>Peak friction {self.peak_friction}</b> at slip {self.critical_slip}; "
            f"{self.consistency.verdict}, {self.samples.used} samples, {self.estimator}</p>"
            + _svg(self.peak_friction, self.critical_slip, self.correlation)
        )

    def __getstate__(self) -> _Object:
        return {**self.__dict__, "_engine": None}


def estimate_of(native: _native.Estimate) -> Estimate:
    """The dataclass of what the engine answers."""
    of = json.loads(native.json)
    return Estimate(
        _json=native.json,
        estimator=of["estimator"],
        peak_friction=_made(Quantity, of["peak_friction"]),
        critical_slip=_made(Quantity, of["critical_slip"]),
        correlation=of["correlation"],
        samples=_made(Samples, of["samples"]),
        consistency=_made(Consistency, of["consistency"]),
        _engine=native,
    )


@dataclass(frozen=True)
class Fit(_Result):
    """What ``muslip fit`` prints, as attributes."""

    peak_friction: Quantity
    critical_slip: Quantity
    correlation: float
    iterations: int
    converged: bool
    rmse_friction: float
    samples: Samples

    def plot(self, ax: Any = None) -> Any:
        """Draw the curve with its band by matplotlib; answers with the axes."""
        return _plot_curve(self, ax, None)

    def _repr_html_(self) -> str:
        return (
            f"<p><b>Peak friction {self.peak_friction}</b> at slip {self.critical_slip}; rmse "
            f"{self.rmse_friction:.3g}</p>" + _svg(self.peak_friction, self.critical_slip, self.correlation)
        )


def fit_of(text: str) -> Fit:
    """The dataclass of a fit's JSON."""
    of = json.loads(text)
    return Fit(
        _json=text,
        peak_friction=_made(Quantity, of["peak_friction"]),
        critical_slip=_made(Quantity, of["critical_slip"]),
        correlation=of["correlation"],
        iterations=of["iterations"],
        converged=of["converged"],
        rmse_friction=of["rmse_friction"],
        samples=_made(Samples, of["samples"]),
    )


@dataclass(frozen=True)
class Channel:
    """A channel of a file, as ``muslip channels --json`` lists it."""

    group: str
    name: str
    unit: str
    samples: int
    first_s: float | None
    last_s: float | None
    rate_hz: float | None
    invalid: int
    comment: str
    kind: str
    role: str | None


@dataclass(frozen=True)
class Parameter:
    """A figure of a mechanism, with its unit."""

    name: str
    value: float
    std: float
    unit: str


@dataclass(frozen=True)
class Evidence:
    """Why a mechanism is believed."""

    delta_bic: float
    holdout_nll_gain_per_sample: float
    confidence: float


@dataclass(frozen=True)
class Alternative:
    """Another mechanism that could be meant."""

    id: str
    confidence: float


@dataclass(frozen=True)
class Mechanism:
    """A mechanism that the simulation lacks."""

    id: str
    balance: str
    statement: str
    equation: str
    parameters: tuple[Parameter, ...]
    evidence: Evidence
    confusable_with: tuple[Alternative, ...]
    separating_test: str


@dataclass(frozen=True)
class Finding:
    """A finding about the measuring chain."""

    recording: str
    channel: str
    relative_to: str
    finding: str
    value: float
    std: float
    unit: str
    statement: str


@dataclass(frozen=True)
class DataFault:
    """Something of the data that cannot be used as it is."""

    recording: str
    channel: str
    start_s: float
    end_s: float
    what: str


@dataclass(frozen=True)
class Unexplained:
    """What no mechanism explains."""

    balance: str
    variable: str
    form: str
    z: float
    share: float


@dataclass(frozen=True)
class Diagnosis(_Result):
    """What ``muslip diagnose`` finds, as attributes; all of it by :meth:`to_dict`."""

    verdict: str
    mechanisms: tuple[Mechanism, ...]
    chain: tuple[Finding, ...]
    unexplained: tuple[Unexplained, ...]
    data_faults: tuple[DataFault, ...]
    base: dict[str, Quantity]
    _engine: _native.Diagnosed | None = field(repr=False, compare=False, default=None)

    def _kept(self) -> _native.Diagnosed:
        if self._engine is None:
            raise MuslipError("error: a diagnosis that was pickled has no model and no report")
        return self._engine

    @property
    def model(self) -> _native.Model:
        """The repaired model: ``model.save("model.toml")``, ``model.text``."""
        return _native.Model.of_text(self._kept().model_text())

    def report(self, path: str | os.PathLike[str]) -> None:
        """Write the page that ``muslip diagnose`` writes."""
        _write(path, self._kept().report_html())

    def _before_after(self) -> list[tuple[str, float, float]]:
        return [(which, of["before"]["rmse_n"], of["after"]["rmse_n"]) for which, of in self.to_dict()["fit"].items()]

    def plot(self, ax: Any = None) -> Any:
        """Draw the error of the drag before and after the repair by matplotlib; answers with the axes."""
        from matplotlib import pyplot

        if ax is None:
            _, ax = pyplot.subplots()
        rows = self._before_after()
        at = np.arange(len(rows))
        ax.bar(at - 0.2, [row[1] for row in rows], 0.4, label="before")
        ax.bar(at + 0.2, [row[2] for row in rows], 0.4, label="after")
        ax.set_xticks(at, [row[0] for row in rows])
        ax.set(ylabel="rms error of the drag (N)", title=self.verdict)
        ax.legend()
        return ax

    def _repr_html_(self) -> str:
        from html import escape

        rows = "".join(
            f"<tr><td>{which}</td><td>{before:.4g}</td><td>{after:.4g}</td></tr>" for which, before, after in self._before_after()
        )
        names = "".join(f"<li>{escape(m.statement)} (confidence {m.evidence.confidence:.2f})</li>" for m in self.mechanisms)
        return (
            f"<p><b>{escape(self.verdict)}</b></p><ul>{names}</ul><table><tr><th>rms error of the drag (N)</th>"
            f"<th>before</th><th>after</th></tr>{rows}</table>"
        )

    def __getstate__(self) -> _Object:
        return {**self.__dict__, "_engine": None}


def diagnosis_of(native: _native.Diagnosed) -> Diagnosis:
    """The dataclass of what the engine answers."""
    of = json.loads(native.json)
    mechanisms = tuple(
        Mechanism(
            id=one["id"],
            balance=one["balance"],
            statement=one["statement"],
            equation=one["equation"],
            parameters=_many(Parameter, one["parameters"]),
            evidence=_made(Evidence, one["evidence"]),
            confusable_with=_many(Alternative, one["confusable_with"]),
            separating_test=one["separating_test"],
        )
        for one in of["mechanisms"]
    )
    return Diagnosis(
        _json=native.json,
        verdict=of["verdict"],
        mechanisms=mechanisms,
        chain=_many(Finding, of["chain"]),
        unexplained=_many(Unexplained, of["unexplained"]),
        data_faults=_many(DataFault, of["data_faults"]),
        base={name: _made(Quantity, one) for name, one in of["base"].items()},
        _engine=native,
    )
