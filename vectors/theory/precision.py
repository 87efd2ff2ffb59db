#!/usr/bin/env python3
"""Remakes precision.csv: the Cramer-Rao bound of a Gaussian pulse in histogram bins, with 34 digits.

delta = sqrt(<1/FI>) over the pulse's position within a bin; FI = sum of (d lambda/d eps)^2 / lambda over the bins,
lambda = mu_B + mu_S * (share of the pulse). Everything as it stands; mpmath's exponents have no limit.
"""
import csv
import sys
from mpmath import mp, mpf, erfc, exp, sqrt, pi, quad, ceil

mp.dps = 34


def information(eps, a, sigma, background, signal):
    reach = int(ceil(13 * sigma / a)) + 2
    total = mpf(0)
    edges = [((j - mpf(1) / 2) * a - eps) / sigma for j in range(-reach, reach + 2)]
    density = [exp(-z * z / 2) / sqrt(2 * pi) / sigma for z in edges]
    above = [erfc(abs(z) / sqrt(2)) / 2 for z in edges]
    for i in range(len(edges) - 1):
        if edges[i] >= 0:
            share = above[i] - above[i + 1]
        elif edges[i + 1] <= 0:
            share = above[i + 1] - above[i]
        else:
            share = 1 - above[i] - above[i + 1]
        rate = background + signal * share
        if rate > 0:
            total += (signal * (density[i] - density[i + 1])) ** 2 / rate
    return total


def bound(a, sigma, background, signal):
    a, sigma, background, signal = (mpf(x) for x in (a, sigma, background, signal))
    marks, width = [mpf(0)], sigma**2 / a / 2
    while width < a / 2:
        marks.append(width)
        width *= 2
    marks.append(a / 2)
    mean = quad(lambda e: 1 / information(e, a, sigma, background, signal), marks, maxdegree=6) * 2 / a
    return sqrt(mean)


CASES = [(1, 1.5, b, s) for b in (100,) for s in (100, 1000, 100000)]
CASES += [(1, 1.5, 0, s) for s in (1e-3, 1, 1e9)] + [(1, 1.5, 1e-6, 1e9), (1, 1.5, 1e6, 1e-3), (1, 1.5, 1e9, 1e9)]
CASES += [(1, s, b, n) for s in (0.02, 0.05, 0.15, 0.4) for b, n in ((0, 1), (0, 1e9), (1, 1e3), (1e4, 10))]
CASES += [(5, 3.397, 0.1, 0.0285), (2.6, 1.911, 300, 250), (1, 12, 3, 200), (1, 40, 0, 10), (1, 40, 0.1, 1e5)]

with open("precision.csv", "w", newline="") as file:
    out = csv.writer(file, lineterminator="\n")
    out.writerow(["bin_ns", "sigma_ns", "background", "signal", "delta_ns"])
    for case in CASES:
        delta = bound(*case)
        out.writerow([*case, mp.nstr(delta, 20, min_fixed=0, max_fixed=0)])
        print(case, mp.nstr(delta, 8), file=sys.stderr, flush=True)
