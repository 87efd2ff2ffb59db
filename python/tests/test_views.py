"""Pictures, tables and what notebooks show."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

import gdtof
from gdtof._arrays import reason_name
from gdtof._plot import pattern_image


def test_pictures_are_drawn(frame: gdtof.Frame, tmp_path: Path) -> None:
    everything = ["depth", "guide", "truth", "peak", "error", "confidence", "reason", "counts"]
    for maps in ("depth", everything[:4], everything):
        figure = frame.plot(maps, title="a frame")  # type: ignore[arg-type]
        figure.savefig(tmp_path / "maps.png")
        assert (tmp_path / "maps.png").stat().st_size > 5000
    is_on = np.argwhere(frame.reason == gdtof.Reason.DEPTH)[0]
    axes = frame.plot_histogram(int(is_on[0]), int(is_on[1]))
    legend = axes.get_legend()
    assert legend is not None
    assert any("truth" in text.get_text() for text in legend.get_texts())
    off = np.argwhere(frame.start < 0)[0]
    assert "SPADs are off" in frame.plot_histogram(int(off[0]), int(off[1])).texts[0].get_text()
    with pytest.raises(gdtof.InputError, match="outside the 16x16 array"):
        frame.plot_histogram(16, 0)
    with pytest.raises(gdtof.InputError, match="is not a map; give depth"):
        frame.plot("dept")  # type: ignore[arg-type]


def test_scripts_show_windows(frame: gdtof.Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[int] = []
    monkeypatch.setattr(plt, "show", lambda: shown.append(len(plt.get_fignums())))
    plt.close("all")
    is_on = np.argwhere(frame.reason == gdtof.Reason.DEPTH)[0]
    row, col = int(is_on[0]), int(is_on[1])
    # This backend has no windows.
    frame.plot()
    frame.plot_histogram(row, col)
    assert shown == [] and plt.get_fignums() == []
    monkeypatch.setattr(FigureCanvasAgg, "required_interactive_framework", "qt")
    frame.plot()
    assert shown == [1] and len(plt.get_fignums()) == 1
    plt.close("all")
    frame.plot_histogram(row, col)
    assert shown == [1, 1]
    plt.close("all")
    frame.plot(show=False)
    frame.plot_histogram(row, col, show=False)
    assert shown == [1, 1] and plt.get_fignums() == []
    # Axes of yours are yours to show.
    figure, ax = plt.subplots()
    frame.plot_histogram(row, col, ax)
    assert shown == [1, 1] and plt.get_fignums() == [figure.number]
    plt.close("all")


def test_titles_are_words_with_units(frame: gdtof.Frame) -> None:
    figure = frame.plot(["depth", "guide", "truth", "peak", "error", "confidence", "reason", "counts"])
    maps = [ax for ax in figure.axes if ax.get_title()]
    bars = [ax.get_ylabel() for ax in figure.axes if ax.get_ylabel()]
    assert len(maps) == 8 and len(bars) == 7
    for text in [ax.get_title() for ax in maps] + bars:
        assert "_" not in text and ".toml" not in text
    assert all(ax.get_title()[0].isupper() for ax in maps)
    assert bars.count("distance (m)") == 4 and "error (m)" in bars


def test_maps_have_the_colours_and_patterns_of_depth_png(frame: gdtof.Frame, tmp_path: Path) -> None:
    """Pixel by pixel: what `gdtof frame` draws with its own code, and what goes into the axes here."""
    frame.save(tmp_path)
    rows, cols, _ = frame.shape
    side = 512 // max(rows, cols)
    with Image.open(tmp_path / "depth.png") as picture:
        # Below a title, within a margin; image.rs has them.
        drawn = np.asarray(picture.convert("RGB"))[40:][: rows * side, 12:][:, : cols * side].astype(int)
    depth_map = frame.plot("depth").axes[0]
    colours, patterns = depth_map.get_images()
    has_depth = (frame.reason == gdtof.Reason.DEPTH).repeat(side, 0).repeat(side, 1)
    # A depth has one of 224 colours there.
    ours = (colours.to_rgba(np.asarray(colours.get_array()))[..., :3] * 255).repeat(side, 0).repeat(side, 1)
    assert has_depth.any() and (~has_depth).any()
    assert np.abs(drawn - ours)[has_depth].max() < 4
    tiles = pattern_image(frame.reason)
    assert np.array_equal(tiles, np.asarray(patterns.get_array()))
    # Tiles repeat all over a cell: the pixels of the first ones.
    step = tiles.shape[0] // rows
    for y in range(4):
        for x in range(4):
            there, here = drawn[y::side, x::side], tiles[y::step, x::step]
            lost = frame.reason != gdtof.Reason.DEPTH
            assert np.array_equal(there[lost], here[..., :3][lost]), (y, x)
    legend = depth_map.figure.legends[0]
    texts = [text.get_text() for text in legend.get_texts()]
    there_are = [why for why in gdtof.Reason if why is not gdtof.Reason.DEPTH and (frame.reason == why).any()]
    assert sorted(texts) == sorted(f"{reason_name(why)} {(frame.reason == why).sum()}" for why in there_are)


def test_datasets_have_dimensions_and_units(frame: gdtof.Frame) -> None:
    data = frame.to_xarray()
    assert dict(data.sizes) == {"row": 16, "col": 16, "bin": 16, "edge": 17}
    assert data["depth"].attrs["units"] == "m"
    assert data["histograms"].dims == ("row", "col", "bin")
    # A dataset has the frame's memory.
    assert np.shares_memory(data["histograms"].values, frame.histograms)
    moving = next(gdtof.drive("van", gdtof.Sensor(rows=8, cols=8), frames=1, laser_cycles=50))
    assert float(moving.to_xarray()["time"]) > 0.145


def test_datasets_go_into_netcdf_and_come_back(frame: gdtof.Frame, tmp_path: Path) -> None:
    moving = next(gdtof.drive("van", gdtof.Sensor(rows=8, cols=8), frames=1, laser_cycles=50))
    # None of its surfaces is reached, of which a remark tells.
    far = gdtof.frame(gdtof.Sensor(rows=4, cols=4), stop_periods=20, laser_cycles=20)
    assert frame.remark is None and far.remark is not None
    for name, taken in (("still", frame), ("moving", moving), ("far", far)):
        data = taken.to_xarray()
        data.to_netcdf(tmp_path / f"{name}.nc")
        with xarray.open_dataset(tmp_path / f"{name}.nc") as back:
            xarray.testing.assert_identical(back.load(), data)
            for key, variable in data.variables.items():
                assert back[key].dtype == variable.dtype, key
                assert back[key].attrs["units"] == variable.attrs["units"] and variable.attrs["long_name"]
            assert back["depth"].attrs["units"] == back["guide"].attrs["units"] == "m"
            assert back["bin_edges"].attrs["units"] == "ns"
            assert back["histograms"].dtype == np.uint16 and back["in_window"].dtype == np.bool_
            assert np.array_equal(back["histograms"], taken.histograms)
            assert np.array_equal(back["depth"], taken.depth, equal_nan=True)
            assert back["reason"].attrs["flag_meanings"].split()[1] == "no_surface"
            assert back.attrs.get("remark") == getattr(taken, "remark", None)
            # What it was taken with: numbers are numbers, and settings are read back from their text.
            assert back.attrs["seed"] == taken.seed and isinstance(back.attrs["seed"], np.integer)
            assert back.attrs["laser_cycles"] == taken.laser_cycles and isinstance(back.attrs["bin_m"], np.floating)
            assert back.attrs["engine"] == taken.engine == "window"
            assert gdtof.Sensor.from_toml(back.attrs["sensor"]) == taken.sensor
            assert gdtof.Scene.from_toml(back.attrs["scene"], back.attrs["scene_name"]) == taken.scene


def test_a_dataset_says_how_its_frame_was_taken(tmp_path: Path) -> None:
    sensor = gdtof.Sensor(rows=4, cols=4, bins=12)
    dusk = gdtof.Scene("van", {"light.illuminance_klux": 1.5})
    taken = gdtof.frame(sensor, dusk, seed=2**63 - 1, engine="cycle", laser_cycles=20, stop_periods=300)
    taken.to_xarray().to_netcdf(tmp_path / "frame.nc")
    with xarray.open_dataset(tmp_path / "frame.nc") as back:
        attrs = back.attrs
    assert int(attrs["seed"]) == 2**63 - 1 and attrs["engine"] == "cycle" and attrs["stop_periods"] == 300
    again = gdtof.frame(
        gdtof.Sensor.from_toml(attrs["sensor"]),
        gdtof.Scene.from_toml(attrs["scene"]),
        seed=int(attrs["seed"]),
        engine=attrs["engine"],
        laser_cycles=int(attrs["laser_cycles"]),
        stop_periods=int(attrs["stop_periods"]),
    )
    assert np.array_equal(again.histograms, taken.histograms) and taken.histograms.any()
    kept = gdtof.frame(sensor, dusk, tolerance_m=0.05, laser_cycles=20)
    assert kept.to_xarray().attrs["tolerance_m"] == 0.05


def test_all_frames_of_a_drive_have_one_scale(frame: gdtof.Frame) -> None:
    def ends(figure: Figure) -> tuple[float, float]:
        limits: tuple[float, float] = figure.axes[0].images[0].get_clim()
        return limits

    with gdtof.drive("van", gdtof.Sensor(rows=8, cols=8), frames=2, laser_cycles=200) as moving:
        frames = list(moving)
    scales = {ends(taken.plot("depth", show=False)) for taken in frames}
    assert scales == {ends(taken.plot("truth", show=False)) for taken in frames} == {frames[0].scale_m}
    near, far = frames[0].scale_m
    # What the camera pair measures, and not what one frame has.
    depths = frames[0].depth[np.isfinite(frames[0].depth)]
    assert near < depths.min() and depths.max() < far <= 200 and (near, far) != (np.floor(depths.min()), np.ceil(depths.max()))
    depths = frame.depth[np.isfinite(frame.depth)]
    assert ends(frame.plot("depth", show=False)) == (np.floor(depths.min()), np.ceil(depths.max()))


def test_tables_have_a_row_for_each_macropixel(frame: gdtof.Frame) -> None:
    table = frame.to_pandas()
    assert table.index.names == ["row", "col"] and len(table) == 256
    assert table.loc[(3, 5), "start"] == frame.start[3, 5]
    counts = table["reason"].value_counts()
    assert counts["depth"] == frame.summary["depths"]
    assert table["counts"].sum() == frame.histograms.sum()


def test_notebooks_show_tables_whose_names_are_escaped(frame: gdtof.Frame) -> None:
    assert "depths, wrong by more than a bin" in frame._repr_html_()
    assert "clk_hz" in gdtof.Sensor()._repr_html_()
    text = gdtof.Scene().to_toml().replace('"car"', '"<script>alert(1)</script>"')
    shown = gdtof.Scene.from_toml(text)._repr_html_()
    assert "<script>" not in shown and "&lt;script&gt;" in shown
    assert repr(frame).startswith("<Frame 16x16x16: ")


def test_waveforms_are_read(tmp_path: Path) -> None:
    file = tmp_path / "some.vcd"
    file.write_text(
        "$timescale 1 ps $end\n$scope module top $end\n$var wire 1 ! clk $end\n"
        "$var wire 4 # word [3:0] $end\n$var wire 70 % long [69:0] $end\n$upscope $end\n$enddefinitions $end\n"
        f"#0\n$dumpvars\nx!\nbxxxx #\n$end\n#5\n0!\nb101 #\nb1{69 * '0'} %\n#10\n1!\n"
    )
    wave = gdtof.read_vcd(file)
    assert wave.find("") == ["top.clk", "top.word", "top.long"]
    assert wave["clk"].rises_fs().tolist() == [10_000]
    assert wave["word"].values.tolist() == [-1, 5]
    assert wave["word"].at(4_999) == -1 and wave["word"].at(5_000) == 5
    assert wave["long"].at(5_000) == 2**69
    with pytest.raises(KeyError):
        wave["stop"]
    for bad in (tmp_path / "none.vcd", Path(__file__)):
        with pytest.raises(gdtof.InputError):
            gdtof.read_vcd(bad)
