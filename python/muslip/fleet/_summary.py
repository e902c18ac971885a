"""What a fleet says as a whole: pooled estimates, rigs that drift, outliers, how often which mechanism."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _native
from .._errors import MuslipError
from .._results import Quantity, _write
from ._results import GROUPS, RECORDINGS, key_of
from ._results import Results as _Results
from ._storage import Folder

if TYPE_CHECKING:
    import pandas

FACTORS = ("rig", "tyre", "track")
"""What estimates are pooled over."""

STANDS_OUT = 3.5
"""Robust sigma beyond which a recording stands out, as on the page of ``muslip campaign``."""

DRIFT_P = 0.01
"""Probability, of all rigs together, of calling one drifting that does not."""

_FEWEST_DAYS = 5
_MOST_CELLS = 1000


@dataclass(frozen=True)
class Level:
    """One rig, tyre or track: the mean of its recordings with its 1-sigma, and their scatter beyond their own uncertainty."""

    name: str
    recordings: int
    mean: Quantity
    scatter: float


@dataclass(frozen=True)
class Factor:
    """Estimates pooled over the rigs, tyres or tracks as random effects.

    ``between`` is the scatter of their true means; ``crossed`` the same with the other factors in the model, where there are any.
    """

    name: str
    quantity: str
    levels: tuple[Level, ...]
    mean: Quantity
    between: float
    crossed: float | None


@dataclass(frozen=True)
class Drift:
    """The way of a rig's peak friction over its days, each tyre and track counted from its own mean.

    ``p`` is corrected for the number of rigs (Holm).
    """

    rig: str
    per_day: Quantity
    p: float
    days: int
    drifts: bool
    course: tuple[tuple[str, float, float], ...] = field(repr=False)
    """Day, mean and its 1-sigma."""


@dataclass(frozen=True)
class Outlier:
    """A recording that lies further from those of the same rig, tyre and track than they and its own uncertainty explain."""

    path: str
    quantity: str
    value: Quantity
    median: float
    sigmas: float


@dataclass(frozen=True)
class Frequency:
    """How often a mechanism is named, with the 95 % interval (Wilson)."""

    mechanism: str
    named: int
    diagnoses: int
    low: float
    high: float
    confidence: float


@dataclass(frozen=True)
class Summary:
    """What a fleet says as a whole; ``report(path)`` writes the page."""

    results: str
    recordings: int
    estimated: int
    errors: dict[str, int]
    """Reasons with the number of their recordings, most frequent first."""
    peak_friction: Quantity
    critical_slip: Quantity
    factors: tuple[Factor, ...]
    drifts: tuple[Drift, ...]
    outliers: tuple[Outlier, ...]
    mechanisms: tuple[Frequency, ...]
    _points: dict[str, list[Any]] = field(repr=False, compare=False)

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain values."""
        whole = asdict(self)
        del whole["_points"]
        return whole

    def report(self, path: str | os.PathLike[str]) -> None:
        """Write one HTML page: pooled estimates, drifts, outliers, mechanisms, and every recording as a point."""
        whole = json.dumps({**self.to_dict(), "points": self._points})
        command = f"python -m muslip.fleet summary {self.results} --report {os.fspath(path)}"
        _write(path, _native.fleet_page(whole, self.results, command))


def _pooled(values: Any, stds: Any) -> tuple[Quantity, float]:
    """Mean of random effects with its 1-sigma, and their scatter beyond the values' own (DerSimonian and Laird)."""
    from statsmodels.stats.meta_analysis import combine_effects

    values, stds = np.asarray(values, dtype=float), np.asarray(stds, dtype=float)
    if len(values) == 1:
        return Quantity(float(values[0]), float(stds[0])), 0.0
    # Not its iteration, whose absolute tolerance takes the small variances of friction for nothing.
    with np.errstate(invalid="ignore"):
        found = combine_effects(values, stds**2, method_re="chi2")
    if found.tau2 <= 0.0:
        return Quantity(float(found.mean_effect_fe), float(found.sd_eff_w_fe)), 0.0
    return Quantity(float(found.mean_effect_re), float(found.sd_eff_w_re)), float(np.sqrt(found.tau2))


def _levels(frame: pandas.DataFrame, by: str | list[str], quantity: str) -> list[Level]:
    levels = []
    for name, rows in frame.groupby(by, sort=True):
        mean, scatter = _pooled(rows[quantity], rows[quantity + "_std"])
        levels.append(Level(", ".join(map(str, name)) if isinstance(name, tuple) else str(name), len(rows), mean, scatter))
    return levels


def _crossed(frame: pandas.DataFrame, factors: Sequence[str], quantity: str) -> dict[str, float]:
    """Scatter that each factor has of its own: a mixed model of the means by rig, tyre and track (REML)."""
    from statsmodels.regression.mixed_linear_model import MixedLM, VCSpec
    from statsmodels.tools.sm_exceptions import ConvergenceWarning

    if len(factors) < 2:
        return {}
    cells = frame.groupby(list(factors))[quantity].mean().reset_index()
    if not len(factors) < len(cells) <= _MOST_CELLS:
        return {}
    design = [(cells[name].to_numpy()[:, None] == np.unique(cells[name])[None, :]).astype(float) for name in factors]
    names = [[[f"{name}{index}" for index in range(part.shape[1])]] for name, part in zip(factors, design, strict=True)]
    spec = VCSpec(list(factors), names, [[part] for part in design])
    ones = np.ones(len(cells))
    with warnings.catch_warnings():
        # That a factor scatters by nothing, the boundary of what it can, is an answer.
        warnings.simplefilter("ignore", ConvergenceWarning)
        found = MixedLM(cells[quantity].to_numpy(), ones, groups=ones, exog_vc=spec).fit(reml=True)
    return {name: float(np.sqrt(max(variance, 0.0))) for name, variance in zip(factors, found.vcomp, strict=True)}


def _factors(frame: pandas.DataFrame, quantity: str) -> list[Factor]:
    varied = [name for name in FACTORS if frame[name].nunique() > 1]
    known = frame.dropna(subset=varied)
    crossed = _crossed(known, varied, quantity)
    factors = []
    for name in varied:
        levels = _levels(frame.dropna(subset=[name]), name, quantity)
        mean, between = _pooled([one.mean.value for one in levels], [one.mean.std for one in levels])
        factors.append(Factor(name, quantity, tuple(levels), mean, between, crossed.get(name)))
    return factors


def _drifts(frame: pandas.DataFrame) -> list[Drift]:
    import pandas
    from statsmodels.api import OLS, add_constant
    from statsmodels.stats.multitest import multipletests

    dated = frame.dropna(subset=["day", "rig"])
    if dated.empty:
        return []
    cell = dated.groupby(["tyre", "track"], dropna=False)["peak_friction"]
    rest = dated.assign(rest=dated["peak_friction"] - cell.transform("mean") + dated["peak_friction"].mean())
    found = []
    for rig, rows in rest.groupby("rig", sort=True):
        # What a day has in common, its recordings share: a day is one observation.
        days = rows.groupby("day")["rest"].agg(["mean", "std", "size"])
        if len(days) < _FEWEST_DAYS:
            continue
        at = pandas.to_datetime(pandas.Series(days.index)).map(pandas.Timestamp.toordinal).to_numpy(dtype=float)
        line = OLS(days["mean"].to_numpy(), add_constant(at - at.mean())).fit()
        stds = (days["std"] / np.sqrt(days["size"])).fillna(0.0)
        course = tuple(zip(map(str, days.index), days["mean"].tolist(), stds.tolist(), strict=True))
        found.append(
            (
                str(rig),
                Quantity(float(line.params[1]), float(line.bse[1])),
                float(np.nan_to_num(line.pvalues[1], nan=1.0)),
                course,
            )
        )
    if not found:
        return []
    called, corrected, *_ = multipletests([p for _, _, p, _ in found], alpha=DRIFT_P, method="holm")
    return [
        Drift(rig, per_day, float(p), len(course), bool(drifts), course)
        for (rig, per_day, _, course), drifts, p in zip(found, called, corrected, strict=True)
    ]


def _outliers(frame: pandas.DataFrame, quantity: str) -> list[Outlier]:
    cell = frame.groupby(list(FACTORS), dropna=False)[quantity]
    median = cell.transform("median")
    away = frame[quantity] - median
    # 1.4826 times the median deviation is the 1-sigma of a normal scatter.
    scatter = 1.4826 * away.abs().groupby([frame[name] for name in FACTORS], dropna=False).transform("median")
    sigmas = away / np.hypot(scatter, frame[quantity + "_std"])
    is_out = (sigmas.abs() > STANDS_OUT) & (cell.transform("size") > 3)
    table = frame.assign(median=median, sigmas=sigmas)[is_out]
    return [
        Outlier(row.path, quantity, Quantity(getattr(row, quantity), getattr(row, quantity + "_std")), row.median, row.sigmas)
        for row in table.itertuples()
    ]


def _mechanisms(tables: list[list[list[dict[str, Any]] | None]]) -> list[Frequency]:
    from statsmodels.stats.proportion import proportion_confint

    diagnoses = [named for table in tables for named in table if named is not None]
    confidences: dict[str, list[float]] = {}
    for named in diagnoses:
        for one in named:
            confidences.setdefault(one["id"], []).append(one["confidence"])
    found = []
    for mechanism, of in sorted(confidences.items(), key=lambda item: (-len(item[1]), item[0])):
        low, high = proportion_confint(len(of), len(diagnoses), method="wilson")
        found.append(Frequency(mechanism, len(of), len(diagnoses), float(low), float(high), float(np.mean(of))))
    return found


def _read(out: str | os.PathLike[str], schema: Any) -> Any:
    path = os.fspath(out)
    table = _Results(Folder(path), schema, 1).table()
    if table.num_rows == 0 or key_of(schema) not in table.column_names:
        raise MuslipError(f"{path}:1:1: has no row a {key_of(schema)}", path, 1, 1)
    return table


def summary(results: str | os.PathLike[str], diagnoses: str | os.PathLike[str] | None = None) -> Summary:
    """Summarise a data set of :func:`run`, with the mechanisms of one of :func:`diagnose` where there is one.

    Random effects, mixed model and corrections are statsmodels' (``pip install "muslip[fleet]"``).

    Parameters
    ----------
    results : path
        The ``out`` of :func:`run`.
    diagnoses : path, optional
        The ``out`` of :func:`diagnose`.

    Raises
    ------
    MuslipError
        There is no data set, or no recording in it has an estimate.
    """
    table = _read(results, RECORDINGS)
    named = [table["mechanisms"].to_pylist()]
    if diagnoses is not None:
        named.append(_read(diagnoses, GROUPS)["mechanisms"].to_pylist())
    every = table.drop_columns(["mechanisms"]).to_pandas(use_threads=False)
    failed = every["error"].notna()
    frame = every[~failed].sort_values("path").reset_index(drop=True)
    if frame.empty:
        path = os.fspath(results)
        raise MuslipError(f"{path}:1:1: no recording in it has an estimate", path, 1, 1)
    # The same reason for many files, whichever file and line.
    reasons = every.loc[failed, "error"].str.replace(r"^.*?:\d+:\d+: ", "", regex=True).value_counts()
    outliers = [one for quantity in ("peak_friction", "critical_slip") for one in _outliers(frame, quantity)]
    outliers.sort(key=lambda one: (-abs(one.sigmas), one.path))
    return Summary(
        results=os.fspath(results),
        recordings=len(every),
        estimated=len(frame),
        errors={str(reason): int(count) for reason, count in reasons.items()},
        peak_friction=_pooled(frame["peak_friction"], frame["peak_friction_std"])[0],
        critical_slip=_pooled(frame["critical_slip"], frame["critical_slip_std"])[0],
        factors=tuple(one for quantity in ("peak_friction", "critical_slip") for one in _factors(frame, quantity)),
        drifts=tuple(_drifts(frame)),
        outliers=tuple(outliers),
        mechanisms=tuple(_mechanisms(named)),
        _points={name: frame[name].tolist() for name in ("peak_friction", "critical_slip")},
    )
