# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import pytest

from wildshape.inference.export import verify


@pytest.mark.parametrize(
    ("other_cost", "said"), [(0, ""), (2, "; 2 got another cost or confidence by rounding")]
)
def test_scans_of_another_cost_are_said(other_cost, said, wildshape, tmp_path, monkeypatch):
    def export(model, out, scans):
        out.touch()
        return verify.Difference(1e-6, 0, scans, other_cost)

    monkeypatch.setattr(verify, "export_model", export)
    found = wildshape("export", "--out", tmp_path / "model.onnx")
    assert found.code == 0, found
    assert found.out.endswith(f"over 24 scans 1.0e-06 m{said}\n")
