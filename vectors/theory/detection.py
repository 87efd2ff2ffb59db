#!/usr/bin/env python3
"""Remakes detection.csv and gaussian.csv: probabilities of detection (thesis Eq. 17-19) at high precision.

Everything is summed as it stands, with 360 digits and no asymptotics: point probabilities by recurrence
from 0 or from one exact value, tails by addition, ties as (F^M - F_^M)/(M f). Only above a mean of 10^6
every h-th term of the last sum is taken, with two different h that must agree to 20 digits.
"""
import csv
import sys
from mpmath import mp, mpf, exp, log, loggamma, sqrt, pi, erfc, quad, inf

mp.dps = 360
TINY = mpf(10) ** -350
BINS = [2, 16, 257, 4096]
TIES = ["strict", "random", "loose"]


class Poisson:
    def __init__(self, *means):
        self.mean = sum(mpf(m) for m in means)
        self.variance = self.mean
        self.most = inf

    def at(self, k):
        if self.mean == 0:
            return mpf(k == 0)
        return exp(k * log(self.mean) - self.mean - loggamma(k + 1))

    def ratio(self, k):
        return self.mean / (k + 1)


class Bernoulli:
    def __init__(self, cycles, *photons):
        self.n, self.odds = cycles, mp.expm1(sum(mpf(g) for g in photons))
        self.p = self.odds / (1 + self.odds)
        self.mean = self.n * self.p
        self.variance = self.mean * (1 - self.p)
        self.most = cycles

    def at(self, k):
        choose = loggamma(self.n + 1) - loggamma(k + 1) - loggamma(self.n - k + 1)
        return exp(choose + k * log(self.p) + (self.n - k) * log(1 - self.p))

    def ratio(self, k):
        return self.odds * (self.n - k) / (k + 1)


def table(law, first, last):
    """P(N = k) for first <= k <= last."""
    value = law.at(first)
    values = [value]
    for k in range(first, last):
        value = value * law.ratio(k)
        values.append(value)
    return values


def support(law):
    reach = 45 * sqrt(law.variance) + 150
    first = max(0, int(law.mean - reach))
    last = int(min(law.mean + reach, law.most))
    return first, last


def detection(signal, background):
    """{(bins, ties): (hit, miss)}"""
    (sf, sl), (bf, bl) = support(signal), support(background)
    if sf > bl:  # 45 standard deviations apart and more
        return {(m, t): (mpf(1), mpf(0)) for m in BINS for t in TIES}
    first, last = min(sf, bf), max(sl, bl)
    f, g = table(signal, first, last), table(background, first, last)
    steps = [1] if signal.mean < 10**6 else [max(1, int(sqrt(background.variance) / k)) for k in (40, 57)]
    sums = []
    for step in steps:
        out = {(m, t): [mpf(0), mpf(0)] for m in BINS for t in TIES}
        above, pending = mpf(0), {}
        for i in range(len(g) - 1, -1, -1):
            if i % step == 0 and f[i] > TINY:
                pending[i] = above
            above += g[i]
        # above is now the whole sum; what is missing from 1 lies below `first`.
        assert abs(above - 1) < mpf(10) ** -100, (first, mp.nstr(above - 1, 5))
        for i, over in pending.items():
            at_most = 1 - over if over < 0.5 or i > 400 else sum(g[: i + 1])
            below = at_most - g[i] if i > 0 or first > 0 else mpf(0)
            for m in BINS:
                for t in TIES:
                    if t == "strict":
                        win = below ** (m - 1)
                    elif t == "loose":
                        win = at_most ** (m - 1)
                    elif g[i] < mpf(10) ** -170:
                        win = at_most ** (m - 1) * (1 - (m - 1) * g[i] / at_most / 2)
                    else:
                        win = (at_most**m - below**m) / (m * g[i])
                    out[m, t][0] += step * f[i] * win
                    out[m, t][1] += step * f[i] * (1 - win)
        sums.append(out)
    if len(sums) == 2:
        for key in sums[0]:
            for a, b in zip(sums[0][key], sums[1][key]):
                assert abs(a - b) <= mpf(10) ** -20 * a or a < mpf(10) ** -290, (key, mp.nstr(a, 30), mp.nstr(b, 30))
    return sums[0]


def text(x):
    return mp.nstr(x, 20, min_fixed=0, max_fixed=0) if x > mpf(10) ** -290 else "0"


def gaussian(signal, background, bins, printed):
    """Eq. 18-19 in Eq. 17: a sum over x >= 0."""
    total, background = mpf(signal) + mpf(background), mpf(background)
    s, b = (total, background) if printed else (sqrt(total), sqrt(background))

    def term(x):
        return exp(-(((x - total) / s) ** 2) / 2) / (s * sqrt(2 * pi)) * (erfc(-(x - background) / b / sqrt(2)) / 2) ** (bins - 1)

    first, last = max(0, int(total - 14 * s)), int(total + 14 * s) + 2
    if last - first < 6000:
        return sum(term(mpf(x)) for x in range(first, last))
    # Euler and Maclaurin at the lower end, whose first neglected term is far below 1e-16.
    marks = sorted({mpf(first), mpf(last)} | {m + k * w for m, w in ((total, s), (background, b)) for k in range(-14, 15) if first < m + k * w < last})
    start = mpf(first)
    correction = term(start) / 2 - mp.diff(term, start) / 12 + mp.diff(term, start, 3) / 720
    return quad(term, marks, maxdegree=9) + correction


def main():
    cases = [("poisson", "", s, b) for b, s in [
        ("1e-6", "1e-6"), ("1e-6", "1"), ("1e-6", "1e3"), ("1e-6", "1e9"), ("1e-3", "1e-6"), ("1e-3", "0.1"), ("0.1", "1e-3"),
        ("0.1", "5"), ("1", "1e-6"), ("1", "1"), ("1", "30"), ("10", "0.5"), ("10", "20"), ("10", "1e3"), ("300", "1e-6"), ("300", "70"),
        ("300", "1500"), ("5e3", "400"), ("1e5", "1e3"), ("1e5", "9e3"), ("2.5e6", "1e4"), ("1e9", "1e-6"), ("1e9", "2e5"), ("1e9", "1e9")]]
    cases += [("bernoulli", n, s, b) for n, s, b in [
        ("1", "0.3", "0.1"), ("10", "1e-6", "1e-6"), ("100", "0.05", "0.2"), ("1000", "0.1", "0.5"), ("1000", "0.1", "0.125"),
        ("16000", "0.016", "0.02"), ("16000", "1e-3", "1e-5"), ("16000", "8", "3"), ("1000000", "1e-3", "0.02")]]
    with open("detection.csv", "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["counts", "cycles", "signal", "background", "bins", "ties", "hit", "miss"])
        for law, n, s, b in cases:
            s_f, b_f = float(s), float(b)
            if law == "poisson":
                result = detection(Poisson(s_f, b_f), Poisson(b_f))
            else:
                result = detection(Bernoulli(int(n), s_f, b_f), Bernoulli(int(n), b_f))
            for (m, t), (hit, miss) in result.items():
                out.writerow([law, n, s, b, m, t, text(hit), text(miss)])
            print(law, n, s, b, file=sys.stderr)
    mp.dps = 40
    with open("gaussian.csv", "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["form", "signal", "background", "bins", "hit"])
        for s, b in [("1e-6", "1e-6"), ("0.5", "0.1"), ("3", "2"), ("40", "300"), ("1e3", "1e4"), ("3e5", "1e6"), ("1e7", "10"), ("1e5", "1e9"), ("1e9", "1e9")]:
            for m in (2, 16, 4096):
                for form in ("meant", "printed"):
                    out.writerow([form, s, b, m, mp.nstr(gaussian(float(s), float(b), m, form == "printed"), 20, min_fixed=0, max_fixed=0)])
            print("gaussian", s, b, file=sys.stderr)


main()
