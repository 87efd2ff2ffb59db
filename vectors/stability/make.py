#!/usr/bin/env python3
"""References for `tests/figures/functions_keep_their_promises.rs`, at 60 digits with mpmath.

Each file has a header, then one line per case: arguments as the exact doubles they are, and last the reference.
Formulas here are written for clarity at high precision, never for stability at double precision.
"""

from fractions import Fraction
from pathlib import Path

from mpmath import mp, mpf

mp.dps = 60
HERE = Path(__file__).parent


def write(name, header, rows, functions=1):
    with open(HERE / f"{name}.csv", "w") as out:
        print(",".join(header) + ",reference" * functions, file=out)
        for row in rows:
            texts = [repr(float(a)) for a in row[:-functions]]
            texts += [str(r) if isinstance(r, (int, str)) else mp.nstr(r, 25) for r in row[-functions:]]
            print(",".join(texts), file=out)


def normal_below(z):
    return mp.erfc(-z / mp.sqrt(2)) / 2


def pulse_share():
    """Share of a Gaussian between two times: far tails, narrow and wide stretches, pulses much shorter than a bin."""
    for sigma in [1e-6, 1e-3, 0.1, 0.73, 1.0, 50.0, 1e6]:
        for z in [-30.0, -8.3, -1.0, -1e-9, 0.0, 1e-3, 0.5, 3.0, 12.0, 30.0]:
            for width in [1e-9, 1e-4, 0.09, 0.5, 2.0, 1e3]:
                start = z * sigma
                end = start + width * sigma
                if not start < end:
                    continue
                a, b = mpf(start) / mpf(sigma), mpf(end) / mpf(sigma)
                if a > 0:  # mirrored, where erfc keeps its digits
                    a, b = -b, -a
                share = normal_below(b) - normal_below(a)
                if share > mpf(10) ** -300:
                    yield start, end, sigma, share
    # The pulse is all of the bin, all but nothing of it, or cut in half.
    for start, end, share in [(-1.0, 1.0, 1), (-1.0, 0.5, 1), (0.0, 1.0, mpf(1) / 2), (-1.0, 0.0, mpf(1) / 2)]:
        yield start, end, 1e-6, mpf(share)


def normal_draws():
    """Quantiles of the standard normal distribution for 49-bit words: the sign, then the tail beyond in steps of 2^-49."""
    for power in range(48):
        for steps in sorted({1 << power, (1 << power) + (1 << power) // 3, (2 << power) - 1}):
            tail = (mpf(steps) + mpf(1) / 2) / 2**49
            z = mp.sqrt(2) * mp.erfinv(2 * tail - 1)
            yield steps, z
            yield steps + 2**48, -z


RATES = [1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 0.02, 0.1, 0.5, 1.0, 3.0, 10.0, 34.5, 100.0, 1e3]


def hit_tails():
    """At least k of 16 SPADs hit, `mean` photons on each: p within 1e-15 of 0 and of 1."""
    for mean in RATES[:-2]:
        p = -mp.expm1(-mpf(mean))
        for k in range(17):
            tail = mp.fsum(mp.binomial(16, j) * p**j * (1 - p) ** (16 - j) for j in range(k, 17))
            if tail > mpf(10) ** -290:
                yield k, mean, tail


def none_hit():
    """(1 - p)^n for n to 1e9."""
    for n in [1, 16, 64, 65, 1000, 16_000, 1_000_000, 1_000_000_000]:
        for p in [1e-15, 1e-12, 1e-9, 1e-6, 9.99e-4, 1e-3, 0.1, 0.5]:
            none = (1 - mpf(p)) ** n
            if none > mpf(10) ** -290:
                yield n, p, none


def able(steps, age):
    whole = int(steps)
    rest = mpf(steps) - whole
    if age < whole:
        return mpf(0)
    if age == whole:
        return (1 - rest) ** 2 / 2
    if age == whole + 1:
        return 1 - rest**2 / 2
    return mpf(1)


def steady_pulse():
    """Pulses of one SPAD per step in even light. Law 0 non-paralysable, 1 paralysable; the mean over a renewal."""
    for law in [0, 1]:
        for steps in [1.0, 1.5, 3.072, 8.0, 61.44, 1000.25]:
            for mean in RATES:
                p = -mp.expm1(-mpf(mean))
                last = int(steps) + 1
                survives, spent, pulses = mpf(1), mpf(0), mpf(0)
                for age in range(1, last + 1):
                    spent += survives
                    renews = p * able(steps, age) if law == 0 else p
                    pulses += survives * p * able(steps, age)
                    survives *= 1 - renews
                # Then free until the next photon.
                spent += survives / p
                pulses += survives
                value = pulses / spent
                if value > mpf(10) ** -290:
                    yield law, steps, mean, value


def poisson_exceedance():
    """P(N > k), which the photon stream keeps as 64-bit fixed-point numbers."""
    for mean in [1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 0.02, 1.0, 7.5, 30.0, 64.0]:
        for k in [0, 1, 2, 5, 10, 30, 64, 100, 150]:
            terms = mp.fsum(mpf(mean) ** j / mp.factorial(j) for j in range(k + 1, k + 400))
            yield mean, k, terms * mp.exp(-mpf(mean))


def clock_edges():
    """Half periods in femtoseconds, rounded to the nearest (halves up): whole numbers, compared as such."""
    for hz in [1, 80_000, 100_000_000, 333_333_333, 384_000_000, 999_999_937, 1_000_000_000_000]:
        for k in [-1, 0, 1, 2, 3, 1001, 10**6 + 1, 10**9, 2 * 10**12 - 1, 2 * 10**12]:
            exact = Fraction(k * 10**15, 2 * hz)
            edge = (2 * exact.numerator + exact.denominator) // (2 * exact.denominator)
            if abs(edge) < 2**63:
                yield hz, k, edge


def counters():
    """A bin after `hits` hits. Overflow 0 saturates, 1 wraps."""
    for bits in [1, 8, 14, 16]:
        full = 2**bits - 1
        for hits in sorted({0, 1, full - 1, full, full + 1, full + 2, 2 * full + 1, 2 * full + 2, 10**9}):
            yield bits, 0, hits, min(hits, full)
            yield bits, 1, hits, hits % (full + 1)


def window_edges():
    """Rising CLK edge that takes a bin's photons at 384 MHz, phase 0: edge cycle * periods + start - 16 + bin."""
    for start in [0, 1, 16, 17, 255, 256, 511]:
        for cycle in [0, 1, 16_000, 1_000_000_000]:
            for bin in [0, 15]:
                number = 2 * (cycle * 520 + start - 16 + bin) + 1
                exact = Fraction(number * 10**15, 2 * 384_000_000)
                edge = (2 * exact.numerator + exact.denominator) // (2 * exact.denominator)
                yield start, cycle, bin, edge


def peak_positions():
    """Eq. 28 over two bins either side of the fullest, less the median of the others; nan where there is no peak."""
    histograms = [
        [0] * 16,
        [7] * 16,
        [1] + [0] * 15,
        [0] * 15 + [1],
        [16383] * 16,
        [16383] * 15 + [16382],
        [2**32 - 1] * 8 + [2**32 - 2] * 8,
        [0, 0, 0, 0, 0, 0, 0, 1, 2**32 - 1, 1, 0, 0, 0, 0, 0, 0],
        [1000, 1001, 999, 1000, 1002, 998, 1000, 1003, 1004, 1003, 1000, 999, 1001, 1000, 1000, 1000],
        [10**9 + (i == 7) + 3 * (i == 8) for i in range(16)],
        [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 3, 10, 6, 1],
        [5, 7, 5, 10, 20, 6, 3, 6, 4, 5, 5, 5, 5, 5, 5, 5],
    ]
    for counts in histograms:
        top = max(range(16), key=lambda i: (counts[i], -i))
        near = range(max(top - 2, 0), min(top + 3, 16))
        others = sorted(Fraction(counts[i]) for i in range(16) if i not in near)
        median = (others[(len(others) - 1) // 2] + others[len(others) // 2]) / 2
        signal = {i: max(counts[i] - median, Fraction(0)) for i in near}
        total = sum(signal.values())
        if total == 0:
            yield *counts, "nan"
            continue
        position = sum(i * s for i, s in signal.items()) / total
        yield *counts, mpf(position.numerator) / position.denominator


def thompson():
    """Eq. 20: (sigma^2 + a^2/12) / N + 4 sqrt(pi) sigma^3 b / (a N^2), under the root."""
    for bin_ns in [1e-3, 1.0, 2.6, 1e3]:
        for ratio in [1e-6, 1e-3, 0.3, 1.5, 40.0, 1e6]:
            sigma = ratio * bin_ns
            for background in [0.0, 1e-12, 1e-3, 1.0, 300.0, 1e9]:
                for signal in [1e-12, 1e-3, 1.0, 250.0, 1e9]:
                    a, s, b, n = (mpf(x) for x in (bin_ns, sigma, background, signal))
                    variance = (s**2 + a**2 / 12) / n + 4 * mp.sqrt(mp.pi) * s**3 * b / (a * n**2)
                    yield bin_ns, sigma, background, signal, mp.sqrt(variance)


def normal_tails():
    """P(Z > z) and ln P(Z < z): both ends, where either is near 1 and where it is all but 0, and the branches at ±1."""
    for z in [-1e5, -37.5, -20.0, -8.3, -3.0, -1.0000001, -1.0, -0.9999, -0.3, -1e-9, -1e-300, 0.0, 1e-300, 1e-9, 0.3, 0.9999,
              1.0, 1.0001, 2.5, 4.9, 7.07, 7.08, 12.0, 20.0, 30.0, 37.0]:
        below = normal_below(mpf(z))
        yield z, normal_below(-mpf(z)), mp.log(below) if z < 0 else mp.log1p(-normal_below(-mpf(z)))


def stirling_errors():
    """ln n! less Stirling's formula, whose leading terms cancel to 1/(12 n)."""
    for n in [1, 2, 3, 7, 15, 16, 17, 50, 1000, 123_457, 10**9, 10**15, 2**53]:
        yield n, mp.loggamma(n + 1) - (n * mp.log(n) - n + mp.log(2 * mp.pi * n) / 2)


def windows():
    """Share of normal errors inside a window whose centre is uniformly off by up to half a step."""
    for sigma in [1e-3, 0.05, 0.4, 1.04, 6.0, 1e3]:
        for window in [0.01, 1.0, 6.25, 100.0]:
            for ratio in [0.0, 1e-9, 1e-6, 1.1e-6, 1e-4, 1e-2, 0.5, 1.0]:
                step = min(ratio * sigma, window) if ratio < 0.5 else ratio * window
                s, half, width = mpf(sigma), mpf(window) / 2, mpf(step)

                def below(t):  # the integral of normal_below
                    return t * normal_below(t) + mp.npdf(t)

                if step == 0:
                    share = mp.erf(half / s / mp.sqrt(2))
                else:
                    low, high = (half - width / 2) / s, (half + width / 2) / s
                    share = 2 * s / width * (below(high) - below(low)) - 1
                yield sigma, window, step, share


def periods():
    """CLK periods in which any of n SPADs fire, or an odd number: 1e-15 to 1/2 avalanches of each in a period."""
    for spads in [1, 2, 16, 1000]:
        for chance in [1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 0.25, 0.49, 0.5, 0.75, 1.0]:
            rate, clk = chance * 384e6, 384e6
            p = mpf(rate) / mpf(clk)
            any_of = clk * (1 - (1 - p) ** spads)
            yield spads, rate, clk, any_of, clk * (1 - (1 - 2 * p) ** spads) / 2


def hits():
    """(1 - exp(-x))/x, its slope, and 1 less it: about the seam at 0.01, at both ends."""
    for x in [1e-15, 1e-9, 1e-6, 1e-4, 5e-3, 9.999e-3, 1e-2, 1.0001e-2, 0.1, 1.0, 7.5, 40.0, 700.0]:
        t = mpf(x)
        missed = -mp.expm1(-t) / t
        yield x, missed, (mp.exp(-t) - missed) / t, 1 - missed


def false_alarms():
    """ln of the chance that some bin of 16 is as full as the fullest, where the counts fall into any cycle of any bin alike."""
    for cycles in [100, 16_000, 1_000_000]:
        for background in [0, 1, 30, 900]:
            for extra in [1, 2, 10, 60]:
                counts = [background] * 16
                counts[5] += extra
                if counts[5] > cycles:
                    continue
                k, marked, drawn, cells = counts[5], sum(counts), cycles, 16 * cycles
                term = mp.mpf(1) * mp.binomial(drawn, k) * mp.binomial(cells - drawn, marked - k) / mp.binomial(cells, marked)
                tail, x = mpf(0), k
                while x <= min(marked, drawn) and term > mpf(10) ** -70 * tail:
                    tail += term
                    term *= mpf(marked - x) * (drawn - x) / (mpf(x + 1) * (cells - marked - drawn + x + 1))
                    x += 1
                yield background, extra, cycles, min(mp.log(16 * tail), mpf(0))


def shares():
    """Ends of Wilson's 95 % interval, which are within 1e-9 of 0 and 1 and of each other."""
    z = mpf(1.959_963_984_540_054)
    for trials in [1.0, 3.0, 40.0, 1000.0, 1e6, 1e9]:
        for p in [0.0, 1e-9, 1e-6, 0.01, 0.3, 0.5, 0.99, 1.0]:
            successes = p * trials
            n, q = mpf(trials), mpf(successes) / mpf(trials)
            middle = (q + z**2 / (2 * n)) / (1 + z**2 / n)
            half = z / (1 + z**2 / n) * mp.sqrt(q * (1 - q) / n + z**2 / (4 * n * n))
            yield successes, trials, middle - half if q else mpf(0), middle + half if q < 1 else mpf(1)


def arrivals():
    """Place by which half of a pulse's counts had come: 3 bins before the fullest to 6 after, less the median of the others."""
    for counts, *_ in [(row[:16],) for row in peak_positions()]:
        top = max(range(16), key=lambda i: (counts[i], -i))
        first, end = max(top - 3, 0), min(top + 7, 16)
        others = sorted(Fraction(c) for c in counts[:first] + counts[end:])
        median = (others[(len(others) - 1) // 2] + others[len(others) // 2]) / 2
        signal = [max(c - median, Fraction(0)) for c in counts[first:end]]
        if sum(signal) == 0:
            yield *counts, "nan"
            continue
        wanted, bin = sum(signal) / 2, 0
        while signal[bin] < wanted and first + bin + 1 < end:
            wanted -= signal[bin]
            bin += 1
        place = first + bin - Fraction(1, 2) + wanted / signal[bin]
        yield *counts, mpf(place.numerator) / place.denominator


write("pulse_share", ["from", "to", "sigma"], pulse_share())
write("normal_draws", ["word"], normal_draws())
write("hit_tails", ["k", "mean"], hit_tails())
write("none_hit", ["n", "p"], none_hit())
write("steady_pulse", ["law", "steps", "mean"], steady_pulse())
write("poisson_exceedance", ["mean", "k"], poisson_exceedance())
write("clock_edges", ["hz", "k"], clock_edges())
write("counters", ["bits", "overflow", "hits"], counters())
write("window_edges", ["start", "cycle", "bin"], window_edges())
write("peak_positions", [f"bin_{i}" for i in range(16)], peak_positions())
write("thompson", ["bin_ns", "sigma_ns", "background", "signal"], thompson())
write("normal_tails", ["z"], normal_tails(), 2)
write("stirling_errors", ["n"], stirling_errors())
write("windows", ["sigma", "window", "step"], windows())
write("periods", ["spads", "avalanches_hz", "clk_hz"], periods(), 2)
write("hits", ["x"], hits(), 3)
write("false_alarms", ["background", "extra", "cycles"], false_alarms())
write("shares", ["successes", "trials"], shares(), 2)
write("arrivals", [f"bin_{i}" for i in range(16)], arrivals())
