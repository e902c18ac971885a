#!/usr/bin/env python3
"""scipy's curve_fit and filterpy's extended Kalman filter on the article's sampling.

    pip install numpy scipy filterpy
    python3 docs/scripts/peers.py [STREAMS]          # RMSE of curve_fit over the Cramer-Rao bound
    python3 docs/scripts/peers.py --rate             # filter runs a second of filterpy, beside ours

The streams are numpy's own (PCG64, seeds from 0), so that only ratios to the bound compare with
docs/estimators.md. --rate runs `cargo run --release -p muslip --example throughput` first and adds a row to its table;
THROUGHPUT names a built one in its place.
"""
import os
import subprocess
import sys
import time

import numpy as np

SIGMA = 0.04
SLIPS = (np.arange(41) / 40.0) ** 2
PEAKS = (0.1, 0.2, 0.35, 0.6, 1.0)
CRITICAL_SLIPS = (0.10, 0.125, 0.15, 0.175, 0.20)


def law(slip, mup, sp):
    return 2.0 * mup * slip * sp / (slip**2 + sp**2)


def gradient(slip, mup, sp):
    d = slip**2 + sp**2
    return np.array([2.0 * slip * sp / d, 2.0 * mup * slip * (slip**2 - sp**2) / d**2])


def accuracy(streams):
    from scipy.optimize import curve_fit

    print(f"scipy's curve_fit, 41 samples, sigma {SIGMA}, {streams} streams a curve: RMSE over the Cramer-Rao bound\n")
    print("| mup | sp | mup, sp |\n| --- | --- | --- |")
    for mup in PEAKS:
        start = (1.0, 0.2) if mup > 0.6 else (0.6, 0.2)
        for sp in CRITICAL_SLIPS:
            h = gradient(SLIPS, mup, sp)
            bound = SIGMA * np.sqrt(np.diag(np.linalg.inv(h @ h.T)))
            errors = []
            for seed in range(streams):
                noise = np.random.default_rng(seed).normal(0.0, SIGMA, SLIPS.size)
                try:
                    found, _ = curve_fit(law, SLIPS, law(SLIPS, mup, sp) + noise, start)
                except RuntimeError:
                    continue
                if 0.0 < found[1] < 2.0:
                    errors.append(found - (mup, sp))
            rmse = np.sqrt(np.mean(np.square(errors), axis=0))
            print(f"| {mup} | {sp} | {rmse[0] / bound[0]:.2f}, {rmse[1] / bound[1]:.2f} |")


def rate():
    from filterpy.kalman import ExtendedKalmanFilter

    built = os.environ.get("THROUGHPUT")
    command = [built] if built else "cargo run --quiet --release -p muslip --example throughput".split()
    table = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    print(table, end="")
    rows = [line.split("|")[1:3] for line in table.splitlines()]
    nalgebra = next(float(runs) for name, runs in rows if name.strip().startswith("nalgebra"))

    noise = np.random.default_rng(0).normal(0.0, SIGMA, SLIPS.size)
    readings = law(SLIPS, 0.35, 0.15) + noise

    def run():
        ekf = ExtendedKalmanFilter(dim_x=2, dim_z=1)
        ekf.x = np.array([[0.6], [0.2]])
        ekf.P = np.diag([0.36, 0.04])
        for slip, reading in zip(SLIPS, readings):
            mup, sp = ekf.x[:, 0]
            h = gradient(slip, mup, sp)
            by_both = h[1] / mup
            second = law(slip, mup, sp) * (sp**2 - 3.0 * slip**2) / (slip**2 + sp**2) ** 2
            p = ekf.P
            pseudonoise = p[1, 1] * (by_both**2 * p[0, 0] + second**2 * p[1, 1])
            ekf.R = np.array([[(3.0 * SIGMA) ** 2 + pseudonoise]])
            ekf.update(
                np.array([[reading]]),
                HJacobian=lambda x, h=h: h.reshape(1, 2),
                Hx=lambda x, s=slip: np.array([[law(s, x[0, 0], x[1, 0])]]),
            )
        return ekf.x

    run()
    runs, begin = 0, time.process_time()
    while time.process_time() - begin < 1.0:
        run()
        runs += 1
    a_second = runs / (time.process_time() - begin)
    print(f"| filterpy | {a_second:.2e} | {a_second / nalgebra:.5f} |")


if __name__ == "__main__":
    if "--rate" in sys.argv[1:]:
        rate()
    else:
        accuracy(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
