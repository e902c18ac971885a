#!/usr/bin/env python3
"""scipy's curve_fit and filterpy's Kalman filters on the streams of the estimators' comparison.

    python3 -m venv venv && venv/bin/pip install numpy scipy filterpy
    cargo run -p study-estimators --release -- 1000 --export streams.jsonl
    venv/bin/python docs/scripts/peers.py accuracy streams.jsonl
    venv/bin/python docs/scripts/peers.py rate [RUNS]

accuracy prints the RMSE of curve_fit beside those of our estimators on the same streams, how far curve_fit's optimum is
from our maximum likelihood, and how far filterpy's extended and unscented filters are from ours. rate runs `cargo run
--release -p muslip --example throughput -- RUNS` and adds a row for filterpy to its table. Tables are in Markdown;
`cargo xtask estimators --write --python venv/bin/python` puts both into docs/estimators.md.
"""
import argparse
import importlib.metadata
import json
import math
import subprocess
import sys
import time

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from scipy.optimize import curve_fit

# The article's filter takes the noise as three times what it is told.
INFLATION = 3.0
# Streams a curve on which filterpy's filters, which take a millisecond a sample, are compared with ours.
FILTERPY_STREAMS = 5
# Runs of filterpy that are timed.
FILTERPY_RUNS = 500
OURS = ("ml", "efficient", "article", "iterated", "unscented")


def law(slip, mup, sp):
    return 2.0 * mup * slip * sp / (slip**2 + sp**2)


def gradient(slip, mup, sp):
    d = slip**2 + sp**2
    return np.array([2.0 * slip * sp / d, 2.0 * mup * slip * (slip**2 - sp**2) / d**2])


def versions():
    return ", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("numpy", "scipy", "filterpy"))


def article_by_filterpy(slips, frictions, start, sigma):
    """The article's filter: second-order pseudonoise, inflated noise, covariance of the start its square."""
    ekf = ExtendedKalmanFilter(dim_x=2, dim_z=1)
    ekf.x = np.array(start, dtype=float).reshape(2, 1)
    ekf.P = np.diag(np.square(start))
    for slip, friction in zip(slips, frictions):
        mup, sp = ekf.x[:, 0]
        h = gradient(slip, mup, sp)
        by_both = h[1] / mup
        half_second = law(slip, mup, sp) * (sp**2 - 3.0 * slip**2) / (slip**2 + sp**2) ** 2
        p = ekf.P
        pseudonoise = p[1, 1] * (by_both**2 * p[0, 0] + half_second**2 * p[1, 1])
        ekf.R = np.array([[(INFLATION * sigma) ** 2 + pseudonoise]])
        ekf.update(
            np.array([[friction]]),
            HJacobian=lambda x, h=h: h.reshape(1, 2),
            Hx=lambda x, slip=slip: np.array([[law(slip, x[0, 0], x[1, 0])]]),
        )
    return ekf.x[:, 0]


def unscented_by_filterpy(slips, frictions, start, sigma):
    points = MerweScaledSigmaPoints(2, alpha=1.0, beta=0.0, kappa=1.0)
    ukf = UnscentedKalmanFilter(
        dim_x=2, dim_z=1, dt=1.0, fx=lambda x, dt: x, hx=lambda x, slip: np.array([law(slip, *x)]), points=points
    )
    ukf.x = np.array(start, dtype=float)
    ukf.P = np.diag(np.square(start))
    ukf.Q = np.zeros((2, 2))
    ukf.R = np.array([[sigma**2]])
    for slip, friction in zip(slips, frictions):
        ukf.predict()
        ukf.update(np.array([friction]), slip=slip)
    return ukf.x


class Curve:
    """Errors on the streams of one curve."""

    def __init__(self, line):
        self.truth = np.array([line["mup"], line["sp"]])
        self.bound = np.array(line["bound"])
        self.streams = 0
        self.squares = {}
        # |curve_fit - ML| in sigmas of the bound, and runs that ended elsewhere.
        self.apart, self.elsewhere = 0.0, 0
        self.filterpy = {"article": 0.0, "unscented": 0.0}

    def add(self, name, estimate):
        error = (np.asarray(estimate) - self.truth) / self.bound
        self.squares[name] = self.squares.get(name, 0.0) + error**2

    def over_bound(self, name):
        return np.sqrt(self.squares[name] / self.streams)


def accuracy(path):
    with open(path, encoding="utf-8") as file:
        head = json.loads(file.readline())
        slips, sigma = np.array(head["slips"]), head["sigma"]
        curves = {}
        for line in map(json.loads, file):
            if line["ml"] is None:
                continue
            curve = curves.setdefault((line["mup"], line["sp"]), Curve(line))
            curve.streams += 1
            frictions = np.array(line["frictions"])
            try:
                found, _ = curve_fit(law, slips, frictions, line["start"])
            except RuntimeError:
                found = np.full(2, math.inf)
            # The law is the same for (mup, sp) and (-mup, -sp).
            found = found * math.copysign(1.0, found[1])
            apart = np.max(np.abs(found - line["ml"]) / curve.bound)
            if apart < 0.5:
                curve.apart = max(curve.apart, apart)
                curve.add("curve_fit", found)
            else:
                curve.elsewhere += 1
                curve.add("curve_fit", line["ml"])
            for name in OURS:
                curve.add(name, line[name])
            if line["seed"] < FILTERPY_STREAMS:
                for name, run in (("article", article_by_filterpy), ("unscented", unscented_by_filterpy)):
                    try:
                        theirs = run(slips, frictions, line["start"], sigma)
                    except np.linalg.LinAlgError:
                        continue
                    off = np.max(np.abs(theirs - line[name]) / np.maximum(np.abs(line[name]), 1e-3))
                    curve.filterpy[name] = max(curve.filterpy[name], off)

    streams = max(curve.streams for curve in curves.values())
    print(
        f"41 samples, sigma {sigma}, the first {streams} of the streams above; {versions()}. RMSE over the Cramér-Rao "
        "bound (mup, sp), and the largest distance of curve_fit's optimum from our ML's in sigmas of the bound.\n"
    )
    print("| mup | sp | curve_fit | ML | efficient | article | iterated | unscented | curve_fit - ML, largest |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for (mup, sp), curve in curves.items():
        ratios = (curve.over_bound(name) for name in ("curve_fit", *OURS))
        cells = (", ".join(f"{value:.3f}" if value < 10 else f"{value:.1f}" for value in ratio) for ratio in ratios)
        print(f"| {mup} | {sp} | {' | '.join(cells)} | {curve.apart:.1e} |")
    elsewhere = sum(curve.elsewhere for curve in curves.values())
    fits = sum(curve.streams for curve in curves.values())
    print(
        f"\ncurve_fit and our ML found the same optimum to {max(c.apart for c in curves.values()):.1e} sigma of the bound "
        f"in {fits - elsewhere} of {fits} fits; in {elsewhere} curve_fit failed or ended elsewhere (there ML's estimate is "
        "counted for it). filterpy's filters against ours, "
        f"largest relative difference of the final estimate on {FILTERPY_STREAMS} streams a curve: extended with the "
        f"article's pseudonoise {max(c.filterpy['article'] for c in curves.values()):.0e}, unscented "
        f"{max(c.filterpy['unscented'] for c in curves.values()):.0e}."
    )


def rate(runs):
    command = f"cargo run --quiet --release --locked -p muslip --example throughput -- {runs}".split()
    table = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout.rstrip("\n").splitlines()
    by_nalgebra = next(float(row.split("|")[3]) for row in table if row.startswith("| nalgebra"))

    slips = (np.arange(41) / 40.0) ** 2
    sigma, start = 0.04, (0.6, 0.2)
    streams = law(slips, 0.35, 0.15) + np.random.default_rng(0).normal(0.0, sigma, (FILTERPY_RUNS, slips.size))
    article_by_filterpy(slips, streams[0], start, sigma)
    begin = time.process_time()
    for frictions in streams:
        article_by_filterpy(slips, frictions, start, sigma)
    by_filterpy = FILTERPY_RUNS / (time.process_time() - begin)

    filterpy = f"| filterpy, the same filter, double precision | {FILTERPY_RUNS} | {by_filterpy:.2e} | {by_filterpy / by_nalgebra:.5f} |"
    end = max(number for number, row in enumerate(table) if row.startswith("|")) + 1
    for row in (*table[:end], filterpy, *table[end:]):
        cells = row.split("|")
        if not row.startswith("|"):
            print(row)
        elif cells[1].strip().startswith("runs of"):
            print(f"{row} over filterpy |")
        elif set(row) <= set("|- "):
            print(f"{row} --- |")
        else:
            print(f"{row} {float(cells[3]) / by_filterpy:.0f} |")
    print(f"\n{versions()}, Python {sys.version.split()[0]}.")


def main():
    parser = argparse.ArgumentParser(description="scipy and filterpy beside our estimators")
    commands = parser.add_subparsers(required=True, dest="command")
    accuracy_parser = commands.add_parser("accuracy", help="errors on the same streams")
    accuracy_parser.add_argument("file", help="what `study-estimators STREAMS --export FILE` wrote")
    rate_parser = commands.add_parser("rate", help="filter runs a second")
    rate_parser.add_argument("runs", nargs="?", type=int, default=1_000_000, help="runs of each of our filters")
    arguments = parser.parse_args()
    if arguments.command == "accuracy":
        accuracy(arguments.file)
    else:
        rate(arguments.runs)


if __name__ == "__main__":
    main()
