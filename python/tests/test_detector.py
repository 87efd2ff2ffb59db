"""Histograms of any sensor."""

import gdtof
import numpy as np
import pytest


def tof(first_of: int | None = None) -> gdtof.Detector:
    return gdtof.Detector(bins=48, bin_ns=0.8, pulse_fwhm_ns=1.5, start_ns=2.0, first_of=first_of)


def drawn(detector: gdtof.Detector, depths: np.ndarray, photons: float, background: float) -> np.ndarray:
    """Counts drawn laser cycle by laser cycle with NumPy alone."""
    random = np.random.default_rng(5)
    cycles = 4000
    counts = np.zeros((len(depths), detector.bins), dtype=np.int64)
    for zone, depth in enumerate(depths):
        for _ in range(cycles):
            centre = 2 * depth / 0.299792458
            echo = random.normal(centre, detector.pulse_fwhm_ns / 2.354820045, random.poisson(photons / cycles))
            span = detector.bins * detector.bin_ns
            light = random.uniform(0, span, random.poisson(background / cycles)) + detector.start_ns
            times = np.concatenate([echo, light])
            bins = np.floor((times - detector.start_ns) / detector.bin_ns).astype(int)
            bins = bins[(bins >= 0) & (bins < detector.bins)]
            if detector.first_of is not None:
                bins = np.sort(bins)[:1]
            np.add.at(counts[zone], bins, 1)
    return counts


@pytest.mark.parametrize("first_of", [None, 4000])
def test_depths_and_checks_of_photons_drawn_by_numpy(first_of: int | None) -> None:
    detector = tof(first_of)
    depths = np.linspace(1.5, 4.5, 7)
    counts = drawn(detector, depths, 1500, 2500)
    found = detector.range(counts)
    assert (np.abs(found.depth - depths) < 5 * found.bound).all()
    assert (np.abs(found.photons / 1500 - 1) < 0.2).all()
    means = np.stack([detector.expected(depth, 1500, 2500) for depth in depths])
    assert min(agreement.p for agreement in detector.check(counts, means)) > 1e-3
    wrong = np.stack([detector.expected(depth + 0.2, 1500, 2500) for depth in depths])
    assert max(agreement.p for agreement in detector.check(counts, wrong)) < 1e-3


def test_counts_of_any_type_order_and_shape_are_the_same() -> None:
    detector = tof()
    counts = detector.expected(3.0, 900, 480).round().astype(np.uint16)
    whole = np.stack([counts, counts[::-1]]).reshape(2, 1, -1)
    first = detector.range(whole)
    assert first.depth.shape == (2, 1) and first.returns.shape == (2, 1, 4)
    for same in (whole.astype(np.float32), np.asfortranarray(whole), whole.tolist(), np.ma.array(whole)):
        assert np.array_equal(detector.range(same).depth, first.depth)
    assert detector.range(counts).depth.shape == ()
    assert detector.range(counts > 20).depth.shape == ()


def test_what_cannot_be_is_said() -> None:
    detector = tof()
    with pytest.raises(gdtof.InputError, match="48 bins in the last axis"):
        detector.range(np.zeros((3, 47), dtype=int))
    with pytest.raises(gdtof.InputError, match="whole"):
        detector.range(np.full(48, 0.5))
    with pytest.raises(gdtof.InputError, match="masked"):
        detector.range(np.ma.masked_equal(np.zeros(48, dtype=int), 0))
    with pytest.raises(gdtof.InputError, match="from 0"):
        detector.range(np.full(48, -1))
    with pytest.raises(gdtof.InputError, match="bin_ns"):
        gdtof.Detector(bins=48, bin_ns=0, pulse_fwhm_ns=1)
    with pytest.raises(gdtof.InputError, match="laser cycles"):
        tof(10).range(np.full(48, 3))
    assert detector.range(np.zeros(48, dtype=int)).reason == "no significant peak"
    with pytest.raises(gdtof.InputError, match="shape"):
        detector.check(np.zeros((2, 48), dtype=int), np.zeros((3, 48)))
