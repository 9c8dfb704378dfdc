# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Text scans as other programs write them: the right columns, or one sentence."""

from pathlib import Path

import pytest
from tests.io.limits import read_within_limits

from wildshape.errors import BadInputError
from wildshape.io.scans.points import Coordinates, read_points


def _read(path: Path, text: str, coordinates: Coordinates | None = None) -> list[list[float]]:
    path.write_bytes(text.encode())
    return read_points(path, coordinates or Coordinates()).tolist()


@pytest.mark.parametrize(
    "text",
    [
        "X (m),Y (m),Z (m),intensity,range,ring\n1,2,3,9,8,7\n4,5,6,9,8,7\n",
        "intensity,range,Z (m),Y (m),X (m)\n9,8,3,2,1\n9,8,6,5,4\n",
        "intensity X (m) Y (m) Z (m)\n9 1 2 3\n9 4 5 6\n",
        "//intensity X Y Z\n2\n9 1 2 3\n9 4 5 6\n",
        "//R,G,B,X,Y,Z\n9,9,9,1,2,3\n9,9,9,4,5,6\n",
        "# made by a program\n# ring x y z\n9 1 2 3\n9 4 5 6\n",
        "# columns: ring x y z\n9 1 2 3\n9 4 5 6\n",
        "#Fields: ring, x, y, z\n9 1 2 3\n9 4 5 6\n",
        "# scanned in x y z order by a program\n1 2 3\n4 5 6\n",
        "time;x_m;y_m;z_m\n9;1;2;3\n9;4;5;6\n",
        "Points:0,Points:1,Points:2,intensity\n1,2,3,9\n4,5,6,9\n",
        "intensity,Points_m_XYZ:0,Points_m_XYZ:1,Points_m_XYZ:2\n9,1,2,3\n9,4,5,6\n",
        "time,position.x,position_y,POS.Z,orientation_x\n9,1,2,3,9\n9,4,5,6,9\n",
        "stamp,x,y,z\n2020-01-01 00:00:00,1,2,3\n2020-01-01 00:00:00,4,5,6\n",
        'name,x,y,z\n"a, b",1,2,3\n"c",4,5,6\n',
        '"ring"\t"x"\t"y"\t"z"\n\t1\t2\t3\n9\t4\t5\t6\n',
        "ring,x,y,z\n,1,2,3\n9,4,5,6\n",
        "x,y,z,ring,\n1,2,3,,\n4,5,6\n",
        "x,y,z\n1,2,3\n4,5,6,,\n",
        'x,y,z,name\n1,2,3,a\n4,5,6,"b, c, d"\n',
        "x;y;z\n1,0;2,0;3,0\n4,0;5,0;6,0\n",
        "1 2 3 # the first\n4 5 6\n",
    ],
)
def test_columns_are_found_by_their_names(text: str, tmp_path: Path) -> None:
    assert _read(tmp_path / "a.csv", text) == [[1, 2, 3], [4, 5, 6]]


@pytest.mark.parametrize("gap", ["", " ", "NA", "nan", "null"])
def test_an_empty_cell_is_a_missing_number_and_shifts_nothing(gap: str, tmp_path: Path) -> None:
    text = f"x,y,z,ring\n1,2,3,4\n5,{gap},7,8\n9,10,11,\n"
    assert _read(tmp_path / "a.csv", text) == [[1, 2, 3], [9, 10, 11]]
    assert _read(tmp_path / "a.csv", text.partition("\n")[2]) == [[1, 2, 3], [9, 10, 11]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 2 3 4\n5 7 8\n", "fewer values than the first"),
        ("ring x y z\n9 1 2 3\n4 5 6\n", "fewer values than the first"),
        ("x,y,z\n1,2,3\n1,5,2,5,3,5\n", "more values than the first"),
        ("1,2,3,\n1,5,2,3,\n", "more values than the first"),
        ('"x" "y" "z"\n"1" 1 2 3\n', "names 3 columns"),
        ("ring x y z\n1 2 3\n", "names 4 columns"),
        ("intensity,lon,lat,alt\n1,2,3,4\n", "names x, y and z"),
        ("a scan of a car\n1 2 3\n", "names x, y and z"),
        ("car,1,2,3\ncar,4,5,6\n", "names x, y and z"),
        ("1,5 2,5 3,5\n1,5 2,5 3,5\n", "names x, y and z"),
        ("x,y,z,x (m)\n1,2,3,4\n", "names a coordinate twice"),
        ("x (ft),y (ft),z (ft)\n1,2,3\n", "in 'ft'"),
        ("x (m),y (m),z (mm)\n1,2,3\n", "in 'm and mm'"),
        ("1 2 3\n4 5 a\n", "damaged or foreign"),
        ("7\n8\n9\n", "names x, y and z"),
    ],
)
def test_what_cannot_be_told_is_refused_in_one_sentence(
    text: str, said: str, tmp_path: Path
) -> None:
    with pytest.raises(BadInputError, match=said) as refused:
        _read(tmp_path / "a.txt", text)
    assert str(refused.value).startswith(str(tmp_path / "a.txt"))
    assert "\n" not in str(refused.value)


def test_the_unit_in_a_header_is_used_and_not_contradicted(tmp_path: Path) -> None:
    for header in ("X (mm),Y (mm),Z (mm)", "x_mm,y_mm,z_mm", "//x [mm],y [mm],z [mm]"):
        text = f"{header}\n1000,2000,3000\n"
        assert _read(tmp_path / "a.csv", text) == [[1, 2, 3]]
        assert _read(tmp_path / "a.csv", text, Coordinates("mm")) == [[1, 2, 3]]
        with pytest.raises(BadInputError, match=r"in mm, but --unit or track\.json says cm"):
            _read(tmp_path / "a.csv", text, Coordinates("cm"))
    with pytest.raises(BadInputError, match="in m, but --unit"):
        _read(tmp_path / "a.csv", "x (m),y (m),z (m)\n1,2,3\n", Coordinates("mm"))


def test_text_costs_what_it_holds(tmp_path: Path) -> None:
    made = {
        "short.xyz": b"1 2 3\n" * 500_000,
        "gaps.csv": b"x,y,z\n" + b"1,,3\n" * 200_000,
        "one_line.csv": b"1," * 20_000_000,
        "wide.csv": (b"1," * 32_000 + b"\n") * 300,
        "header.csv": b"x(" + b" " * 60_000 + b",y,z\n1,2,3\n",
        "comments.csv": (b"#x,y,z" + b",x" * 30_000 + b"\n") * 300 + b"1,2,3\n",
        "blank.csv": b"\n" * 3_000_000,
    }
    for name, content in made.items():
        (tmp_path / name).write_bytes(content)
    files = [tmp_path / name for name in made]
    read_within_limits("wildshape.io.scans.points:read_points", files)
