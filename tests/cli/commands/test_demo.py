# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import json
import shutil

from wildshape.io.store.store import open_store
from wildshape.report.demo.run import FILES

QUICK = ("--preset", "tiny", "--seconds", "0.5", "--tracks", "4", "--test-tracks", "2")
SHORT, NONE = ("--drive-scans", "4"), ("--drive-scans", "0")


def test_demo_on_simulated_and_on_own_scans(wildshape, refused, dataset, tmp_path):
    out = tmp_path / "demo"
    found = wildshape("demo", "--out", out, *QUICK, *SHORT)
    assert found.code == 0, found.err
    lines = found.out.splitlines()
    assert "identity" in lines[0]
    assert "of one scan" in lines[1]
    assert lines[-1] == f"the report is {out / 'report.html'}"
    assert "left in all" in found.err
    assert len(list(out.glob("fused/*.ply"))) > 0
    page = (out / "report.html").read_text("utf-8")
    assert 'href="drive/found/report.html"' in page
    assert "In a simulated drive of 4 scans " in page
    assert 'id="drive_data"' in (out / "drive/found/report.html").read_text("utf-8")
    assert set(open_store(out / "data/train.store").names)
    assert "--overwrite" in refused("demo", "--out", out, *QUICK)
    own = shutil.copytree(dataset, tmp_path / "own")
    for file in own.glob("*/*.*"):
        file.unlink()  # no truth
    found = wildshape("demo", "--out", out, "--data", own, *QUICK, *NONE, "--overwrite", "--json")
    assert found.code == 0, found.err
    said = json.loads(found.out)
    assert "could not be measured" in said["verdict"][0]
    page = (out / "report.html").read_text("utf-8")
    assert "not chosen by any error" in page
    assert "by the error of the model just trained" not in page
    written = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    ours = {str(path.relative_to(out)) for pattern in FILES for path in out.glob(pattern)}
    assert written - ours == {"wildshape.json"}
