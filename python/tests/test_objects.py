"""Sensors, scenes and guides."""

from __future__ import annotations

import copy
import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest

import gdtof

LIBRARY = Path(__file__).parents[2] / "vectors/liberty/example.lib"


def test_sensors_come_from_names_files_and_keys(tmp_path: Path) -> None:
    assert gdtof.Sensor() == gdtof.Sensor("quantic4x4")
    assert gdtof.Sensor("hslidar").bins == 8
    file = tmp_path / "chip.toml"
    file.write_text('rows = 8\nclk_hz = "300 MHz"\n')
    sensor = gdtof.Sensor(file, cols=4)
    assert sensor.shape == (8, 4, 16)
    assert sensor.clk_hz == sensor["clk_hz"] == 300e6
    assert gdtof.Sensor(str(file), cols=4) == sensor
    assert sensor.with_(rows=np.int64(2), clk_hz=np.float64(1e8)).to_dict() == {
        **sensor.to_dict(),
        "rows": 2,
        "clk_hz": 1e8,
    }
    assert "clk_hz" in dir(sensor) and "with_" in dir(sensor)
    assert dict(sensor.to_dict()) == {key: sensor[key] for key in sensor.keys()}
    assert gdtof.Sensor.from_toml(sensor.to_toml()) == sensor
    assert repr(sensor) == "Sensor(clk_hz=300000000.0, cols=4, rows=8)"
    assert repr(gdtof.Sensor("vcsel_flash", rows=8)) == 'Sensor("vcsel_flash", rows=8)'
    assert repr(gdtof.Sensor(paralysable=True)) == "Sensor(paralysable=True)"
    assert repr(gdtof.Scene("sweep")).startswith("<Scene built-in sweep: ")
    assert len(repr(gdtof.Scene("warehouse"))) < 120 and "more>" in repr(gdtof.Scene("warehouse"))


def test_scenes_come_from_names_files_and_keys(tmp_path: Path) -> None:
    street = gdtof.Scene()
    assert street == gdtof.Scene("street") and street.name == "built-in street"
    darker = street.with_({"object.car.reflectivity": 0.05, "light.illuminance_klux": "10000 lux"})
    assert darker["object.car.reflectivity"] == 0.05
    assert darker["light.illuminance_klux"] == 10.0
    assert street != darker and hash(street) == hash(gdtof.Scene("street"))
    file = tmp_path / "mine.toml"
    file.write_text(darker.to_toml())
    assert gdtof.Scene(file) == darker
    assert street.truth(8, 8).shape == (8, 8)
    van = gdtof.Scene("van")
    assert not np.array_equal(van.truth(32, 64), van.truth(32, 64, time_s=5.0), equal_nan=True)
    with pytest.raises(KeyError):
        street["lidar.pdee"]


def test_a_value_in_another_unit_is_warned_of(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="the sensor: dead_time_ns = 8000 ns .* if you mean 8000 ps, give 8 ns"):
        sensor = gdtof.Sensor(dead_time_ns=8000)
    with pytest.warns(UserWarning, match="8000 ns"):
        gdtof.Sensor.from_dict(sensor.to_dict())
    with pytest.warns(UserWarning, match="built-in street: in .lidar., pulse_fwhm_ns = 5e-9 ns .* give 5 ns"):
        scene = gdtof.Scene("street", {"lidar.pulse_fwhm_ns": 5e-9})
    with pytest.warns(UserWarning, match="5e-9 ns"):
        scene.with_({"lidar.pde": 0.1})
    study = {"study": {"kind": "theory"}, "vary": {"sensor.dead_time_ns": [8, 8000]}}
    with pytest.warns(UserWarning, match="the study: sensor.dead_time_ns = 8000 ns"):
        gdtof.sweep(study, tmp_path / "results")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene.with_({"lidar.pulse_fwhm_ns": "5 ns"})
        sensor.with_(dead_time_ns=8)
        with pytest.raises(UserWarning, match="8000 ns"):
            gdtof.Sensor(dead_time_ns=8000)


@pytest.mark.parametrize("name", ["street", "warehouse", "van", "fog", "glass", "sweep", "night", "empty"])
def test_a_scene_comes_back_from_its_dict(name: str) -> None:
    scene = gdtof.Scene(name)
    back = gdtof.Scene.from_dict(scene.to_dict(), name=scene.name)
    assert back == scene and hash(back) == hash(scene) and back.name == scene.name
    assert back.to_dict() == scene.to_dict() and back.to_toml() == scene.to_toml()


def test_a_scene_with_files_comes_back_from_its_dict(tmp_path: Path) -> None:
    (tmp_path / "pulse.csv").write_text("0,0\n1,1\n3,0\n")
    np.save(tmp_path / "depth.npy", np.full((4, 4), 12.5, np.float32))
    (tmp_path / "scene.toml").write_text(
        '[lidar]\npulse = "pulse.csv"\n[rig]\n[[object]]\nname = "seen"\nkind = "map"\nreflectivity = 0.4\n'
        'depth_file = "depth.npy"\nfocal_px = 5\nwaypoints = [[0, 0, 0, 0], [1, 0.5, 0, 2]]\n'
    )
    scene = gdtof.Scene(tmp_path / "scene.toml")
    back = gdtof.Scene.from_dict(scene.to_dict(), scene.name)
    assert back == scene and hash(back) == hash(scene)
    assert np.array_equal(back.truth(8, 8), scene.truth(8, 8), equal_nan=True) and np.nanmin(back.truth(8, 8)) >= 12.5


def test_scenes_and_sensors_come_from_dicts() -> None:
    values = gdtof.Scene("street").to_dict()
    values["light"]["illuminance_klux"] = np.float64(1.0)
    values["lidar"]["pde"] = "20 %"
    values["medium"] = None
    scene = gdtof.Scene.from_dict(values)
    assert scene["light.illuminance_klux"] == 1.0 and scene["lidar.pde"] == 0.2 and scene.name == "scene"
    # What is left out is as in a scene file, and a dict is read as such a file.
    wall = {"object": [{"name": "wall", "kind": "box", "reflectivity": 0.5, "centre_m": (0, 0, 10), "size_m": np.array([30.0, 30.0, 1.0])}]}
    text = '[[object]]\nname = "wall"\nkind = "box"\nreflectivity = 0.5\ncentre_m = [0, 0, 10]\nsize_m = [30, 30, 1]'
    assert gdtof.Scene.from_dict(wall) == gdtof.Scene.from_toml(text)
    for sensor in (gdtof.Sensor("hslidar_delay_line", rows=4), gdtof.Sensor()):
        back = gdtof.Sensor.from_dict(sensor.to_dict())
        assert back == sensor and hash(back) == hash(sensor)


def test_guides_that_say_the_same_are_equal() -> None:
    metres = np.array([[10.0, np.nan], [20.0, 0.0]])
    same = [
        [gdtof.Guide(), gdtof.Guide("stereo"), gdtof.Guide(gdtof.Guide())],
        [gdtof.Guide("radar:range_sigma_m=0.2"), gdtof.Guide("radar:range_sigma_m=20 cm")],
        [gdtof.Guide("radar:range_sigma_m=0.2,azimuth_beam_deg=4"), gdtof.Guide("radar:azimuth_beam_deg=4,range_sigma_m=0.2")],
        [gdtof.Guide("matched"), gdtof.Guide("matched:")],
        [gdtof.Guide("stereo", "radar"), gdtof.Guide("stereo", gdtof.Guide("radar"))],
        [gdtof.Guide("radar", "stereo")],
        [gdtof.Guide.from_map(metres), gdtof.Guide.from_map(metres.tolist(), sigma_m=1.0), gdtof.Guide.from_map([[10.0, 0.0], [20.0, np.nan]])],
        [gdtof.Guide.from_map(metres, sigma_m=0.5)],
        [gdtof.Guide.from_map(metres.reshape(1, 4))],
        [gdtof.Guide.from_map(np.nextafter(metres, np.inf))],
        [gdtof.Guide("stereo", gdtof.Guide.from_map(metres))],
    ]
    for group, guides in enumerate(same):
        for other, others in enumerate(same):
            for guide in guides:
                for that in others:
                    assert (guide == that) is (group == other), (guide, that)
                    assert (guide != that) is (group != other)
                    assert group != other or hash(guide) == hash(that)
    assert len({guide for guides in same for guide in guides}) == len(same)
    for guide in (guides[-1] for guides in same):
        assert pickle.loads(pickle.dumps(guide)) == guide
    assert gdtof.Guide() != "stereo"


def test_what_has_no_value_is_no_data() -> None:
    metres = np.ma.masked_array([[10.0, 20.0], [np.nan, np.inf]], mask=[[False, True], [False, False]])
    found, _ = gdtof.Guide.from_map(metres).estimate(rows=2, cols=2)
    assert np.array_equal(found, [[10.0, np.nan], [np.nan, np.nan]], equal_nan=True)
    starts = gdtof.starts_for(metres)
    assert starts[0, 0] >= 0 and starts[0, 1] == -1
    sensor = gdtof.Sensor(rows=2, cols=2)
    masked = np.ma.masked_equal(np.array([[60, 61], [62, 63]]), 61)
    with pytest.raises(gdtof.InputError, match="starts: is masked in places"):
        gdtof.frame(sensor, starts=masked, laser_cycles=5)
    counts = np.ma.masked_equal(np.ones((2, 2, 16), np.uint16), 1)
    with pytest.raises(gdtof.InputError, match="histograms: is masked in places"):
        gdtof.range(counts, starts=60, sensor=sensor, laser_cycles=5)


def test_copies_travel() -> None:
    guide = gdtof.Guide("radar", gdtof.Guide.from_map([[1.0, np.nan]], sigma_m=[[0.5, 1.0]]))
    alone = gdtof.Guide.from_map([[1.0, np.nan]], sigma_m=[[0.5, 1.0]])
    for thing in (gdtof.Sensor("hslidar", rows=4), gdtof.Scene("fog", {"lidar.pde": 0.1})):
        assert pickle.loads(pickle.dumps(thing)) == thing
        assert copy.deepcopy(thing) == thing
    for either in (guide, alone):
        back = pickle.loads(pickle.dumps(either))
        assert repr(back) == repr(either)
        for ours, theirs in zip(either.estimate(rows=1, cols=2), back.estimate(rows=1, cols=2), strict=True):
            assert np.array_equal(ours, theirs, equal_nan=True)


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (lambda: gdtof.Sensor(rows=0), "rows = 0 is impossible; give 1 to 256"),
        (lambda: gdtof.Sensor(row=1), "unknown key `row`"),  # type: ignore[call-arg]
        (lambda: gdtof.Sensor(clk_hz="8 ns"), "is a time; give a frequency"),
        (lambda: gdtof.Sensor().with_(rows="many"), "is not a number; give a plain number"),
        (lambda: gdtof.Sensor.from_toml("rows = 0"), "sensor:1: rows = 0 is impossible"),
        (lambda: gdtof.Scene.from_toml("[lidar]\npde = 2", "mine"), "mine:2: in [lidar], pde = 2 is impossible; give 0 to 1"),
        (lambda: gdtof.Scene().with_({"object.cat.reflectivity": 1}), "there is no object \"cat\""),
        (lambda: gdtof.Guide("radar:beam=3"), "unknown key `beam`"),
        (lambda: gdtof.Guide(*["radar"] * 9), "9 guides; give 1 to 8"),
        (lambda: gdtof.frame(engine="windo"), "engine: `windo` is impossible"),  # type: ignore[arg-type]
        (lambda: gdtof.frame(laser_cycles=-1), "laser_cycles: -1 is impossible; give a whole number, 0 to 4294967295"),
        (lambda: gdtof.frame(stop_periods=2.5), "stop_periods: 2.5 is impossible; give a whole number, 0 to 4294967295"),  # type: ignore[arg-type]
        (lambda: gdtof.frame(stop_periods=520.0), "stop_periods: 520.0 is impossible; give 520, without a point"),  # type: ignore[arg-type]
        (lambda: gdtof.frame(skip=1), "skip: 1 is impossible; give true or false"),  # type: ignore[arg-type]
        (lambda: gdtof.frame(seed=2**64), "18446744073709551616 is too large; give 64-bit numbers"),
        (lambda: gdtof.expose(100, laser_cycles=-1), "laser_cycles: -1 is impossible; give a whole number, 0 to 4294967295"),
        (lambda: gdtof.expose(100, seed=1.5), "seed: 1.5 is impossible; give a whole number"),  # type: ignore[arg-type]
        (lambda: gdtof.replay([1], [0], [0], 100, laser_cycles=2**40), "laser_cycles: 1099511627776 is impossible"),
        (lambda: gdtof.range([[[1] * 16]], 100, stop_periods="520"), "stop_periods: '520' is impossible"),  # type: ignore[arg-type]
        (lambda: gdtof.light().photons(period_ns=100, seed=-1), "seed: -1 is impossible"),
        (lambda: gdtof.light(spads=-1), "spads: -1 is impossible"),
        (lambda: gdtof.frame(gdtof.Scene(), gdtof.Sensor()), "sensor: Scene is no sensor; give a Sensor, the name of a built-in one or a file"),  # type: ignore[arg-type]
        (lambda: gdtof.drive(gdtof.Sensor()), "scene: Sensor is no scene; give a Scene, the name of a built-in one or a file"),
        (lambda: gdtof.frame(guide=3), "guide: 3 is no guide; give texts or Guides"),  # type: ignore[arg-type]
        (lambda: gdtof.sweep(gdtof.Sensor()), "study: Sensor is no study; give a file, or a dict of its sections"),
        (lambda: gdtof.drive(segments=2.5), "segments: 2.5 is impossible; give a whole number, 0 to 4294967295"),  # type: ignore[arg-type]
        (lambda: gdtof.Sensor(rows=2.5), "rows = 2.5 is impossible; give a whole number, 1 to 256"),  # type: ignore[arg-type]
        (lambda: gdtof.Sensor.from_dict({"rows": True}), "sensor: rows = true is impossible; give a whole number, 1 to 256"),
        (lambda: gdtof.Scene("street", {"lidar.pde": [1]}), "pde = a list is impossible; give a number, 0 to 1"),
        (lambda: gdtof.Scene.from_dict({"lidar": {"pde": 2}}, "mine"), "mine: in [lidar], pde = 2 is impossible; give 0 to 1"),
        (lambda: gdtof.Scene.from_dict({"lidar": 3}), "scene: lidar: this must be a section"),
        (lambda: gdtof.Scene.from_dict({}), "scene: has no settings"),
        (lambda: gdtof.drive(segments=0), "segments: 0 is impossible; give 1 to 64"),
        (lambda: gdtof.drive(guide_latency_ms=-1), "guide_latency_ms: -1 is not a latency"),
        (lambda: gdtof.drive(frames=-1), "frames: -1 is impossible"),
        (lambda: gdtof.timing(process="best"), "give slow, typ or fast"),  # type: ignore[arg-type]
        (lambda: gdtof.timing("hslidar", voltage_v=5.0), "no delays are known there"),
        (lambda: gdtof.timing(gdtof.Sensor(liberty=str(LIBRARY)), voltage_v=0.9), "a library is characterised at conditions of its own"),
    ],
)
def test_what_cannot_be_is_said_in_a_sentence(ask: object, says: str) -> None:
    assert callable(ask)
    with pytest.raises(gdtof.InputError) as raised:
        ask()
    assert says in str(raised.value), raised.value
    assert isinstance(raised.value, ValueError) and isinstance(raised.value, gdtof.Error)


def test_what_is_no_setting_is_a_type_error() -> None:
    with pytest.raises(TypeError, match="is no value of a setting"):
        gdtof.Sensor(rows=object())  # type: ignore[arg-type]
    with pytest.raises(AttributeError, match="has no key"):
        _ = gdtof.Sensor().row


def test_a_drive_ends_when_it_is_closed() -> None:
    sensor = gdtof.Sensor(rows=8, cols=8)
    with gdtof.drive("van", sensor, frames=None, laser_cycles=100) as drive:
        first = next(drive)
        assert first.number == 0 and drive.period_s > 0.145
    assert list(drive) == []
    still = gdtof.drive("street", sensor, frames=2, laser_cycles=100, noise="still")
    one, two = still
    assert np.array_equal(one.histograms, two.histograms)
    assert two.reused["world"] and two.reused["macropixels"] > 0
