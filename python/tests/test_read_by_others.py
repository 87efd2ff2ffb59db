"""Arrays, pictures, recordings and tables are read by packages that are not ours."""

from __future__ import annotations

import base64
import csv
import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as parquet
import pytest
from conftest import Command
from foxglove import messages as foxglove
from mcap.reader import make_reader
from numpy.typing import NDArray
from PIL import Image


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory, command: Command) -> Path:
    """A frame of 12 by 20 macropixels in `frame`, and all that can be exported of it in `export`."""
    folder = tmp_path_factory.mktemp("exported")
    size = ("--rows", 12, "--cols", 20, "--laser-cycles", 300, "--seed", 3)
    command("frame", *size, "--probe", "none", "--out", folder / "frame")
    command("export", "frame", folder / "frame", "--out", folder / "export")
    return folder


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory, command: Command) -> Path:
    """A drive of three frames with its recording."""
    folder = tmp_path_factory.mktemp("recorded") / "drive"
    size = ("--frames", 3, "--rows", 16, "--cols", 16, "--laser-cycles", 100)
    command("drive", "van", *size, "--mcap", "--out", folder)
    return folder


def depths_of(exported: Path) -> NDArray[np.float32]:
    depths: NDArray[np.float32] = np.load(exported / "export" / "depth.npy")
    return depths


def test_numpy_reads_a_frame(exported: Path) -> None:
    frame = np.load(exported / "export" / "frame.npz")
    names = (
        "bound_m confidence depth_m guide_m histograms in_window no_depth peak_m"
        " returns_bound_m returns_m returns_photons spread_m start truth_m"
    )
    assert sorted(frame.files) == names.split()
    assert frame["histograms"].shape == (12, 20, 16)
    assert (frame["histograms"] == np.load(exported / "frame" / "histograms.npy")).all()
    depths = depths_of(exported)
    assert depths.dtype == np.float32
    assert np.array_equal(depths, frame["depth_m"], equal_nan=True)
    assert ((frame["no_depth"] == 0) == ~np.isnan(depths)).all()


def test_pictures_hold_depths_to_half_their_step(exported: Path) -> None:
    picture = np.asarray(Image.open(exported / "export" / "depth16.png")).astype(float) / 256
    depths = depths_of(exported)
    assert picture.shape == depths.shape
    assert ((picture == 0) == np.isnan(depths)).all()
    assert np.abs(picture - depths)[picture > 0].max() <= 1 / 512


def test_players_find_every_moment_of_a_recording(recorded: Path) -> None:
    with (recorded / "drive.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count == 15 and len(summary.chunk_indexes) == 3
        topics = defaultdict(list)
        for schema, channel, message in reader.iter_messages():
            assert schema is not None and schema.encoding == "jsonschema"
            assert channel.message_encoding == "json"
            json.loads(schema.data)
            topics[channel.topic].append((schema.name, message.log_time, json.loads(message.data)))
        times = [time for _, time, _ in topics["/tf"]]
        assert times == sorted(set(times)) and len(times) == 3
        assert len(list(reader.iter_messages(starting_at=times[1]))) == 10
    assert {topic: of[0][0] for topic, of in topics.items()} == {
        "/lidar/depth": "foxglove.RawImage",
        "/lidar/picture": "foxglove.CompressedImage",
        "/lidar/points": "foxglove.PointCloud",
        "/lidar/windows": "foxglove.SceneUpdate",
        "/tf": "foxglove.FrameTransform",
    }
    depths = np.load(recorded / "depth.npy").astype("<f4")
    for number, (_, time, image) in enumerate(topics["/lidar/depth"]):
        assert image["timestamp"]["sec"] * 10**9 + image["timestamp"]["nsec"] == time
        assert base64.b64decode(image["data"]) == depths[number].tobytes()
        cloud = topics["/lidar/points"][number][2]
        there = np.count_nonzero(~np.isnan(depths[number]))
        kinds = {7: "<f4", 3: "<u2"}
        layout = np.dtype([(field["name"], kinds[field["type"]]) for field in cloud["fields"]])
        assert layout.itemsize == cloud["point_stride"]
        points = np.frombuffer(base64.b64decode(cloud["data"]), layout)
        assert np.count_nonzero(points["return"] == 1) == there and points["return"].max() <= 4
        picture = base64.b64decode(topics["/lidar/picture"][number][2]["data"])
        assert picture == (recorded / f"depth_{number:05}.png").read_bytes()


KINDS = {
    "color": "Color",
    "entities": "SceneEntity",
    "fields": "PackedElementField",
    "lifetime": "Duration",
    "lines": "LinePrimitive",
    "orientation": "Quaternion",
    "points": "Point3",
    "pose": "Pose",
    "position": "Vector3",
    "rotation": "Quaternion",
    "timestamp": "Timestamp",
    "translation": "Vector3",
}
"""Foxglove's type of what a message holds under a key."""

NUMBERED = {
    "LinePrimitive": foxglove.LinePrimitiveLineType,
    "PackedElementField": foxglove.PackedElementFieldNumericType,
}
"""Types whose `type` is one of an enumeration's."""


def by_foxglove(kind: str, message: dict[str, Any]) -> Any:
    """A message as Foxglove's own package makes it, which knows no other keys and types than its schemas'."""

    def value(key: str, held: Any) -> Any:
        if key == "data":
            return base64.b64decode(held, validate=True)
        if key == "type":
            numbered: Any = NUMBERED[kind]
            values = [v for v in vars(numbered).values() if isinstance(v, numbered)]
            return next(v for v in values if int(v) == held)
        if isinstance(held, dict):
            return by_foxglove(KINDS[key], held)
        if isinstance(held, list):
            return [by_foxglove(KINDS[key], each) for each in held]
        return held

    return getattr(foxglove, kind)(**{key: value(key, held) for key, held in message.items()})


def test_messages_are_foxgloves(recorded: Path) -> None:
    with (recorded / "drive.mcap").open("rb") as file:
        messages = [
            (schema.name.removeprefix("foxglove."), json.loads(message.data))
            for schema, _, message in make_reader(file).iter_messages()
            if schema is not None
        ]
    assert len(messages) == 15
    for kind, message in messages:
        # Its encoding is another than ours, and holds our bytes.
        encoded = by_foxglove(kind, message).encode()
        assert base64.b64decode(message.get("data", "")) in encoded
        with pytest.raises(TypeError):
            by_foxglove(kind, message | {"unknown": 1})


STUDY = """
[study]
kind = "theory"
[vary]
theory.model = ["bernoulli", "poisson"]
theory.guide_sigma_m = { from = 0.1, to = 9, steps = 36000 }
[fixed]
theory.reflectivity = 0
"""
"""More rows than a group of Parquet has."""


def test_parquet_holds_what_csv_holds(command: Command, tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text(STUDY)
    command("sweep", study, "--out", tmp_path / "out")
    file = parquet.ParquetFile(tmp_path / "out" / "results.parquet")
    assert file.num_row_groups == 2
    table = file.read()
    with (tmp_path / "out" / "results.csv").open(newline="") as text:
        names, *rows = csv.reader(text)
    assert table.column_names == names
    assert table.num_rows == len(rows) == 72000
    for name, cells in zip(names, zip(*rows, strict=True), strict=True):
        for held, cell in zip(table[name].to_pylist(), cells, strict=True):
            assert cell == "" if held is None else type(held)(cell) == held, (name, held, cell)
