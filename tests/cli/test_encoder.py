# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape train --encoder`: another point network, trained, kept, and known for what it is."""

from wildshape.method.checkpoint import load_checkpoint


def test_train_with_another_encoder(wildshape, refused, store, tmp_path):
    run = tmp_path / "run"
    order = ("train", store, "--out", run, "--preset", "tiny", "--steps", 2, "--device", "cpu")
    assert wildshape(*order, "--encoder", "pointnet2").code == 0
    model = run / "model.safetensors"
    assert load_checkpoint(model)[1].network.backbone == "pointnet2"
    assert "finished already" in wildshape(*order, "--encoder", "pointnet2", "--resume").out
    assert "settings" in refused(*order, "--encoder", "dgcnn", "--resume")
    start = ("train", store, "--out", tmp_path / "two", "--preset", "tiny", "--start", model)
    assert "sizes" in refused(*start)
    assert "pointnet2" in refused("export", model, "--out", tmp_path / "model.onnx")
