# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Files of data sets that lie about themselves: refused in a sentence, within the memory rule."""

import zlib

import numpy as np
import pytest
from scipy.io import savemat
from tests.datasets.street import street
from tests.datasets.write_argoverse2 import write_log, write_table
from tests.datasets.write_kitti_raw import tracklet_xml, write_drive
from tests.datasets.write_kitti_tracking import write_sequence
from tests.io.limits import allowed, costs, read_within_limits
from tests.refusal import refused

from wildshape.datasets.argoverse2.log import read_boxes
from wildshape.datasets.kitti.raw import KittiRaw
from wildshape.datasets.kitti.tracking_labels import read_boxes as read_kitti_boxes
from wildshape.datasets.kitti.tracklets import read_tracklets
from wildshape.datasets.rgbd.depth_image import read_png
from wildshape.datasets.shapenet.files import read_model_list, read_shape
from wildshape.datasets.tracks.selection import Selection
from wildshape.datasets.tracks.source import all_tracks
from wildshape.datasets.waymo.tables import read_vehicle_poses
from wildshape.io.guard import read_json

POSES = [(10.0, 2.0, -1.7, 0.1)]


def labels(tmp_path):
    drive = write_drive(tmp_path / "2011_09_26_drive_0001_sync", [("Car", 0, POSES)], {})
    return drive / "tracklet_labels.xml"


@pytest.mark.parametrize(
    "encoding", ["euc-jp", "utf-7", "gbk", "utf-32", "UTF-16", "idna", "bz2", "unknown-8", "ascii"]
)
def test_what_xml_says_of_its_encoding_does_not_matter(tmp_path, encoding):
    path = labels(tmp_path)
    path.write_text(path.read_text().replace('encoding="UTF-8"', f'encoding="{encoding}"'))
    assert f'"{encoding}"' in path.read_text()
    assert len(read_tracklets(path)) == 1


@pytest.mark.parametrize("encoding", ["utf-32", "utf-16"])
def test_xml_in_another_encoding_is_refused(tmp_path, encoding):
    path = labels(tmp_path)
    path.write_bytes(path.read_text().encode(encoding))
    refused(read_tracklets, path, match=r"labels\.xml: expected KITTI's tracklets, XML in UTF-8")


@pytest.mark.parametrize("frame", ["100000000", "1e300", "-1", "0.5", "inf"])
def test_a_first_frame_that_there_is_not(tmp_path, frame):
    path = labels(tmp_path)
    text = path.read_text().replace("<first_frame>0<", f"<first_frame>{frame}<")
    path.write_text(text)
    assert frame in text
    refused(read_tracklets, path, match=r"labels\.xml: tracklet 0")


def test_a_tracklet_long_after_the_last_scan_costs_nothing(tmp_path):
    path = labels(tmp_path)
    path.write_text(path.read_text().replace("<first_frame>0<", "<first_frame>999999<"))
    scan = path.parent / "velodyne_points" / "data" / "0000000000.bin"
    scan.parent.mkdir(parents=True, exist_ok=True)
    np.zeros((4, 4), np.float32).tofile(scan)
    source = KittiRaw(path.parent)
    assert list(all_tracks(source)) == []
    assert source.rejected["scan: the frame has no LiDAR file"] == 1


def test_xml_bombs_keep_to_the_rule(tmp_path):
    entities = '<!DOCTYPE a [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;">]><a>&b;</a>'
    good = tracklet_xml("Car", 0, POSES)
    bombs = {
        "nested": "<a>" * 500_000,
        "flat": f"<x><tracklets>{'<a/>' * 500_000}</tracklets></x>",
        "in an item": f"<x><tracklets><item>{'<a/>' * 500_000}</item></tracklets></x>",
        "entities": entities,
        "many": f"<x><tracklets>{good * 3000}</tracklets></x>",
    }
    paths = [tmp_path / name for name in bombs]
    for path, text in zip(paths, bombs.values()):
        path.write_text(text)
    found = read_within_limits("wildshape.datasets.kitti.tracklets:read_tracklets", paths)
    assert found == {"many"}


@pytest.mark.parametrize("column", range(10, 17))
@pytest.mark.parametrize("value", ["inf", "-inf", "nan"])
def test_numbers_of_kitti_labels_are_finite(tmp_path, column, value):
    write_sequence(tmp_path, street(2, points=50))
    path = tmp_path / "label_02" / "0001.txt"
    words = next(line for line in path.read_text().splitlines() if " Car " in line).split()
    words[column] = value
    path.write_text(" ".join(words) + "\n")
    refused(read_kitti_boxes, path, match=r"0001\.txt, line 1: .*; download KITTI tracking's")


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("tx_m", ["a", "b"]),
        ("length_m", [None, 1.0]),
        ("length_m", [float("inf"), 1.0]),
        ("tx_m", [float("nan"), 1.0]),
        ("timestamp_ns", [None, 1]),
        ("timestamp_ns", [1.0, float("nan")]),
        ("track_uuid", [1, 2]),
        ("category", [None, None]),
        ("category", [{"a": 1}, {"a": 2}]),
    ],
)
def test_columns_of_another_type_are_named(tmp_path, name, values):
    import pyarrow.feather

    log = write_log(tmp_path / "log", street(2, points=50))
    path = log / "annotations.feather"
    table = pyarrow.feather.read_table(path)
    columns = {n: table[n].to_pylist()[:2] for n in table.column_names}
    write_table(path, columns | {name: values})
    refused(read_boxes, log, match=r"annotations\.feather: ")


def test_waymos_columns_of_another_type_are_named(tmp_path):
    import pyarrow
    import pyarrow.parquet

    column = "[VehiclePoseComponent].world_from_vehicle.transform"
    for i, values in enumerate(([["a"]], [None], [[1.0]], [[float("nan")] * 16], [5])):
        path = tmp_path / f"{i}.parquet"
        table = pyarrow.table({"key.frame_timestamp_micros": [1], column: values})
        pyarrow.parquet.write_table(table, path)
        refused(read_vehicle_poses, path, match=rf"{i}\.parquet: ")


def test_rows_that_are_many_for_being_equal(tmp_path):
    import pyarrow
    import pyarrow.parquet

    column = "[VehiclePoseComponent].world_from_vehicle.transform"
    count, one = 300_000, np.arange(16.0)
    lists = pyarrow.ListArray.from_arrays(np.arange(0, 16 * count + 1, 16), np.tile(one, count))
    path = tmp_path / "equal.parquet"
    stamps = np.ones(count, np.int64)
    table = pyarrow.table({"key.frame_timestamp_micros": stamps, column: lists})
    pyarrow.parquet.write_table(table, path, compression="zstd")
    (cost,) = costs("wildshape.datasets.waymo.tables:read_vehicle_poses", [path])
    assert "claims 300000 rows" in cost.error
    assert cost.grown < allowed(path)


@pytest.mark.parametrize("points", [np.full((9, 3), np.nan), np.full((9, 3), np.inf)])
def test_matlab_files_hold_finite_numbers(tmp_path, points):
    path = tmp_path / "downsampled" / "03001627" / "chair.mat"
    path.parent.mkdir(parents=True)
    savemat(path, {"points": points})
    refused(read_shape, tmp_path, "03001627", "chair", match=r"chair\.mat: points holds what is no")
    savemat(path, {"points": np.ones((9, 3))}, format="4")
    refused(read_shape, tmp_path, "03001627", "chair", match=r"chair\.mat: of another version")
    savemat(path, {"points": np.zeros((4_000_000, 3))}, do_compression=True)
    refused(read_shape, tmp_path, "03001627", "chair", match=r"chair\.mat: .*an array of more than")


def png(width, height, bits, data):
    def chunk(kind, body):
        checked = kind + body
        ends = (len(body).to_bytes(4, "big"), zlib.crc32(checked).to_bytes(4, "big"))
        return ends[0] + checked + ends[1]

    sides = width.to_bytes(4, "big") + height.to_bytes(4, "big")
    head = chunk(b"IHDR", sides + bytes((bits, 0, 0, 0, 0)))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", data) + chunk(b"IEND", b"")


@pytest.mark.parametrize(("side", "bits"), [(4000, 16), (60_000, 16), (60_000, 8), (60_000, 1)])
def test_images_larger_than_their_file_can_be(tmp_path, side, bits):
    path = tmp_path / "000000.png"
    rows = zlib.compress(bytes(min(side * (1 + side * bits // 8), 1 << 25)), 1)
    path.write_bytes(png(side, side, bits, rows))
    refused(read_png, path, "a 16-bit depth PNG", match=r"000000\.png: ")


def test_an_image_of_one_depth_is_read(tmp_path):
    path = tmp_path / "000000.png"
    rows = (b"\0" + b"\x03\xe8" * 1920) * 1080
    path.write_bytes(png(1920, 1080, 16, zlib.compress(rows, 9)))
    assert (read_png(path, "a 16-bit depth PNG") == 1000).all()


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        "[1e400",
        "[" + "9" * 5000 + "]",
        "\ud83d\ude00"[:1],
        "[" + "[],{}," * 2_000_000,
    ],
)
def test_json_that_asks_for_much(tmp_path, text):
    path = tmp_path / "camera.json"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    refused(read_json, path, "JSON with fx", match=r"camera\.json: expected JSON with fx")


def test_names_of_models_are_names_of_folders_and_the_list_is_read_once(tmp_path):
    path = tmp_path / "03001627_train.txt"
    path.write_text("a1 b2\n")
    assert read_model_list(path) is read_model_list(path)
    path.write_text("a1 b2 c3\n")
    assert read_model_list(path) == ["a1", "b2", "c3"]
    path.write_text("a" * 300)
    refused(read_model_list, path, match="expected a model a line")
    path.write_text("1 " * 100_000)
    refused(read_model_list, path, match=r"03001627_train\.txt: lists a model twice")


def test_a_feather_table_without_its_columns_is_not_unpacked(tmp_path):
    path = tmp_path / "annotations.feather"
    write_table(path, {"timestamp_ns": np.zeros(1 << 24, np.int64)})
    (cost,) = costs("wildshape.datasets.argoverse2.log:read_boxes", [tmp_path])
    assert "no column track_uuid" in cost.error
    assert cost.grown < allowed(path)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_points_that_are_none_are_no_scan(value):
    points = np.ones((200, 3), np.float32)
    assert Selection().objection_to_scan(points) == ""
    points[7, 1] = value
    assert "its points are none" in Selection().objection_to_scan(points)
