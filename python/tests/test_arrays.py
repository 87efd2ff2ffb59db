"""What a frame holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

import gdtof
from gdtof import _gdtof
from gdtof._arrays import reason_name


def test_arrays_have_their_shapes_and_types(frame: gdtof.Frame) -> None:
    assert frame.shape == (16, 16, 16)
    assert frame.histograms.dtype == np.uint16
    assert frame.bin_edges_ns.shape == (16, 16, 17)
    for array in (frame.depth, frame.guide, frame.truth, frame.peak, frame.confidence):
        assert array.shape == (16, 16) and array.dtype == np.float64
    assert frame.reason.dtype == np.uint8
    assert frame.start.dtype == np.int32
    assert frame.in_window.dtype == np.bool_


def test_arrays_own_what_rust_made(frame: gdtof.Frame) -> None:
    for array in (frame.histograms, frame.depth, frame.bin_edges_ns, frame.reason, frame.start):
        # Memory that NumPy allocated itself would have been copied into.
        assert not array.flags.owndata
        assert type(array.base).__name__ == "PySliceContainer"
        assert array.flags.c_contiguous and array.flags.writeable


def test_reasons_are_the_librarys(frame: gdtof.Frame) -> None:
    assert [reason_name(reason) for reason in gdtof.Reason][1:] == list(_gdtof.REASONS)
    assert np.array_equal(frame.reason == gdtof.Reason.DEPTH, np.isfinite(frame.depth))
    assert len(gdtof.WalkLeft) == len(_gdtof.WALKS_LEFT) + 1
    has_no_bound = np.isfinite(frame.depth) & np.isnan(frame.bound)
    assert (frame.walk_left[has_no_bound] != gdtof.WalkLeft.NONE).all() and has_no_bound.any()
    assert (frame.walk_left[np.isnan(frame.depth)] == gdtof.WalkLeft.NONE).all()
    assert np.array_equal(np.isnan(frame.truth), np.isin(frame.reason, [gdtof.Reason.NO_SURFACE]))
    for name, count in frame.summary["no_depth"].items():
        assert (frame.reason == gdtof.Reason[name.upper()]).sum() == count


def test_points_are_depths_along_rays(frame: gdtof.Frame) -> None:
    at = np.argwhere(np.isfinite(frame.depth))
    assert frame.points.shape == (len(at), 3) and frame.points.dtype == np.float64 and len(at) > 50
    # The pinhole by its field of view, x right, y down, z forward.
    lidar = gdtof.Scene().to_dict()["lidar"]
    tangent = np.tan(np.radians(lidar["fov_deg"]) / 2) / 8
    across, down = (at[:, 1] - 7.5) * tangent, (at[:, 0] - 7.5) * tangent * lidar["macropixel_aspect"]
    rays = np.stack([across, down, np.ones(len(at))], axis=1)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    expected = rays * frame.depth[np.isfinite(frame.depth)][:, None]
    assert np.allclose(frame.points, expected, rtol=1e-12, atol=1e-12)
    nothing = gdtof.frame(frame.sensor, "empty", laser_cycles=20)
    assert nothing.points.shape == (0, 3)
    moving = next(gdtof.drive("van", gdtof.Sensor(rows=8, cols=8), frames=1, laser_cycles=50))
    assert np.allclose(np.linalg.norm(moving.points, axis=1), moving.depth[np.isfinite(moving.depth)])


def test_edges_say_where_bins_are(frame: gdtof.Frame) -> None:
    edges = frame.bin_edges_m
    is_on = frame.start >= 0
    assert np.array_equal(np.isfinite(edges).all(axis=2), is_on)
    assert np.allclose(np.diff(edges[is_on]), frame.bin_m, rtol=1e-4)
    inside = (frame.truth >= edges[:, :, 0]) & (frame.truth < edges[:, :, -1])
    assert np.array_equal(inside, frame.in_window)
    given = gdtof.bin_edges(frame.start, frame.sensor)
    assert np.array_equal(given, frame.bin_edges_ns, equal_nan=True)


def test_windows_and_start_values_go_together(sensor: gdtof.Sensor) -> None:
    windows = gdtof.windows(sensor)
    assert windows.shape == (sensor.largest_start + 1, 2)
    metres = np.array([[10.0, 50.0], [150.0, np.nan]])
    starts = gdtof.starts_for(metres, sensor)
    assert starts.shape == (2, 2) and starts[1, 1] == -1
    for metre, start in zip(metres.flat[:3], starts.flat[:3], strict=True):
        near, far = windows[start]
        assert near <= metre < far
        assert abs((near + far) / 2 - metre) < 0.4
    assert (gdtof.starts_for([1e6, -1.0], sensor) == -1).all()


def test_start_values_of_ones_own(sensor: gdtof.Sensor, frame: gdtof.Frame) -> None:
    again = gdtof.frame(sensor, starts=frame.start, laser_cycles=200)
    assert np.array_equal(again.histograms, frame.histograms)
    assert np.array_equal(again.depth, frame.depth, equal_nan=True)
    one = gdtof.frame(sensor, starts=40, laser_cycles=200)
    assert (one.start == 40).all()
    off = gdtof.frame(sensor, starts=-1, laser_cycles=200)
    assert off.histograms.sum() == 0 and (off.start == -1).all()
    bads: list[tuple[ArrayLike, str]] = [
        (512, "not a start value; give 0 to 511"),
        (np.zeros((3, 3)), "shape"),
        (0.5, "whole"),
    ]
    for bad, says in bads:
        with pytest.raises(gdtof.InputError, match=says):
            gdtof.frame(sensor, starts=bad, laser_cycles=200)


def test_a_guide_of_ones_own(sensor: gdtof.Sensor) -> None:
    truth = gdtof.Scene().truth(16, 16)
    guide = gdtof.Guide.from_map(truth, sigma_m=0.1)
    metres, sigma = guide.estimate(rows=16, cols=16)
    assert np.array_equal(metres, truth, equal_nan=True)
    assert np.array_equal(np.isinf(sigma), np.isnan(truth))
    frame = gdtof.frame(sensor, guide=guide, laser_cycles=200)
    assert np.array_equal(frame.guide, truth, equal_nan=True)
    assert np.array_equal(frame.start, gdtof.starts_for(truth, sensor))
    assert np.array_equal(gdtof.frame(sensor, guide=truth, laser_cycles=200).guide, truth, equal_nan=True)
    fused = gdtof.Guide("stereo", guide)
    assert fused.name == "stereo + file"
    for none in (np.nan, np.inf, 0.0):
        nowhere = gdtof.frame(sensor, guide=np.full((16, 16), none), laser_cycles=50)
        assert (nowhere.start == -1).all()
    for bad, says in [
        (np.full((16, 16), -1.0), "no length"),
        (np.zeros(3), "give rows and columns"),
        (np.ones((2, 2)), "2x2 macropixels and the sensor 16x16"),
    ]:
        with pytest.raises(gdtof.InputError, match=says):
            gdtof.frame(sensor, guide=bad, laser_cycles=50)


def test_a_guides_estimate_is_that_of_its_frame(sensor: gdtof.Sensor, frame: gdtof.Frame) -> None:
    metres, _ = gdtof.Guide("stereo").estimate(rows=16, cols=16, seed=1)
    assert np.array_equal(metres, frame.guide, equal_nan=True)


def test_ranging_a_frames_own_counts_gives_its_depths(sensor: gdtof.Sensor, frame: gdtof.Frame) -> None:
    ranged = gdtof.range(frame.histograms, frame.start, sensor=sensor, laser_cycles=200)
    assert np.array_equal(ranged.depth, frame.depth, equal_nan=True)
    assert np.array_equal(ranged.confidence, frame.confidence, equal_nan=True)
    lists = gdtof.range(frame.histograms.tolist(), frame.start, sensor=sensor, laser_cycles=200)
    assert np.array_equal(lists.depth, frame.depth, equal_nan=True)
    off = gdtof.range(frame.histograms, -1, sensor=sensor, laser_cycles=200)
    assert (off.reason == gdtof.Reason.NO_GUIDE).all()
    with pytest.raises(gdtof.InputError, match="65535"):
        gdtof.range(np.full((16, 16, 16), 70000), frame.start, sensor=sensor)
    with pytest.raises(gdtof.InputError, match="whole"):
        gdtof.range(np.full((16, 16, 16), 0.5), frame.start, sensor=sensor)


def test_light_of_ones_own(sensor: gdtof.Sensor) -> None:
    metres = np.linspace(20.0, 150.0, 256).reshape(16, 16)
    starts = gdtof.starts_for(metres, sensor)
    arrival_ns = 2 * metres / 299_792_458 * 1e9
    lit = gdtof.expose(starts, background_hz=2e6, signal=0.5, arrival_ns=arrival_ns, sensor=sensor)
    ranged = gdtof.range(lit.histograms, starts, sensor=sensor)
    assert np.isfinite(ranged.depth).all()
    assert np.abs(ranged.depth - metres).max() < 0.2
    # A pane before the wall, as a second echo that takes its share.
    signal = np.broadcast_to([0.2, 0.3], (16, 16, 2))
    arrivals = np.stack([arrival_ns - 8.0, arrival_ns], axis=2)
    both = gdtof.expose(starts, signal=signal, arrival_ns=arrivals, sensor=sensor)
    mean = both.histograms.sum(axis=(0, 1)) / 256 / 1000
    assert mean.sum() == pytest.approx(0.5, rel=0.1)
    # What is in the profile's pieces is counted there alone.
    edges = gdtof.bin_edges(starts, sensor)
    dark = gdtof.expose(40, profile_hz=[0.0, 5e7], profile_edges_ns=[0.0, 100.0, 400.0], sensor=sensor)
    late = gdtof.bin_edges(40, sensor)[0, 0]
    assert dark.histograms[:, :, late[:-1] > 400.0].sum() == 0
    assert dark.histograms.sum() == 0 or (late[:-1] < 400.0).any()
    assert edges.shape == (16, 16, 17)
    assert gdtof.expose(-1, background_hz=1e8, sensor=sensor).histograms.sum() == 0


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"background_hz": -1.0}, "background_hz: -1 of macropixel 0 is impossible"),
        ({"signal": np.nan}, "signal: NaN of macropixel 0 is impossible"),
        ({"signal": 1.0, "arrival_ns": -1.0}, "arrival_ns: -1 of macropixel 0"),
        ({"signal": np.ones((3, 3))}, r"signal: is an array of shape \[3, 3\]"),
        ({"profile_hz": [1.0]}, "needs profile_edges_ns"),
        ({"profile_hz": [1.0, 2.0], "profile_edges_ns": [5.0, 1.0, 2.0]}, "edges of a profile rise"),
        ({"engine": "windo"}, "is not an engine; give gate, cycle, window or cohort"),
        ({"laser_cycles": 0}, "laser_cycles: an exposure needs a laser cycle"),
    ],
)
def test_light_that_cannot_be(sensor: gdtof.Sensor, keys: dict[str, object], says: str) -> None:
    with pytest.raises(gdtof.InputError, match=says):
        gdtof.expose(40, sensor=sensor, **keys)  # type: ignore[arg-type]


def test_probes_leave_waveforms(sensor: gdtof.Sensor, tmp_path: Path) -> None:
    frame = gdtof.frame(sensor, laser_cycles=60, probes=[(8, 8)], waves=tmp_path)
    assert frame.probes == [(8, 8)]
    wave = gdtof.read_vcd(tmp_path / "probe_r8_c8.vcd")
    assert len(wave) > 100
    stops = wave[wave.find(r"LOCAL_STOP$")[0]].rises_fs()
    assert len(stops) > 0
    with pytest.raises(gdtof.InputError, match="outside the 16x16 array"):
        gdtof.frame(sensor, laser_cycles=60, probes=[(16, 0)], waves=tmp_path)
    with pytest.raises(gdtof.InputError, match="give waves"):
        gdtof.frame(sensor, laser_cycles=60, probes=[(8, 8)])


def test_timing_tells_what_is_tightest(sensor: gdtof.Sensor) -> None:
    nominal = gdtof.timing(sensor)
    assert nominal.met and nominal.margins[0] == (nominal.check, nominal.path, nominal.slack_ps)
    assert [slack for _, _, slack in nominal.margins] == sorted(slack for _, _, slack in nominal.margins)
    slow = gdtof.timing(sensor, voltage_v=0.9)
    assert slow.ripple_ps > nominal.ripple_ps
    assert not gdtof.timing(sensor.with_(clk_hz="2 GHz")).met


def test_a_guide_or_a_policy_of_another_type_is_refused() -> None:
    with pytest.raises(gdtof.InputError, match="give texts or Guides, or a map as an array"):
        gdtof.frame(guide=[[30.0] * 64] * 64)  # type: ignore[list-item]
    with pytest.raises(gdtof.InputError, match="windows: 3 is no policy"):
        gdtof.frame(windows=3)  # type: ignore[arg-type]
