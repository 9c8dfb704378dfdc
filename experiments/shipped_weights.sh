#!/bin/sh
# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
#
# The figures of the shipped weights in benchmarks/RESULTS.md and results/: simulated drives of procedural and of
# CAD vehicles that no training has seen, and real KITTI cars; three rotation protocols each.
#
#   experiments/shipped_weights.sh CAD_TEST_MESHES KITTI_RAW OUT [WEIGHTS ...]
#
# CAD_TEST_MESHES: folder of vehicle meshes; KITTI_RAW: folder above 2011_09_26; OUT: to write;
# WEIGHTS: other checkpoints to set beside the shipped ones: other seeds, the oracle, those before.
set -eu
meshes=$1 kitti=$2 out=$3
shift 3
mkdir -p "$out"
wildshape simulate "$out/procedural" --tracks 30 --seed 9001
wildshape simulate "$out/more" --tracks 150 --seed 9031
wildshape simulate "$out/still-more" --tracks 150 --seed 9021
wildshape simulate "$out/cad" --tracks 168 --scans 12 --seed 9002 --meshes "$meshes"
wildshape simulate "$out/hdl32" --tracks 30 --seed 9011 --sensor hdl32
wildshape simulate "$out/os1" --tracks 30 --seed 9012 --sensor os1-128
wildshape convert kitti-raw "$kitti" "$out/kitti" --every 2
for data in procedural cad kitti; do
    for rotate in none yaw so3; do
        seeds=3 more=
        [ "$rotate" = none ] && seeds=1 more=--track
        wildshape evaluate "$out/$data" --out "$out/$data-$rotate" --rotate "$rotate" \
            --seeds "$seeds" --max-scans 8 --baselines identity,one-scan,local-icp $more
    done
    wildshape evaluate "$out/$data" --out "$out/$data-raw" --max-scans 8 --baselines none --raw
done
wildshape evaluate "$out/more" --out "$out/more-none" --max-scans 8 --baselines none --track
for rotate in yaw so3; do
    wildshape evaluate "$out/more" --out "$out/more-$rotate" --rotate "$rotate" --max-scans 8 \
        --baselines none
done
wildshape evaluate "$out/still-more" --out "$out/still-more-none" --max-scans 8 --baselines none
if [ $# -gt 0 ]; then
    for data in procedural more still-more cad kitti; do
        wildshape evaluate "$out/$data" --out "$out/$data-others" --max-scans 8 --baselines none \
            --model "$@"
    done
fi
for data in hdl32 os1; do
    wildshape evaluate "$out/$data" --out "$out/$data-yaw" --rotate yaw --max-scans 8 --track \
        --baselines one-scan
done
for data in procedural cad hdl32 os1; do
    protocol=yaw
    case "$data" in procedural | cad) protocol=none ;; esac
    python experiments/by_kind.py --data "$out/$data" --evaluation "$out/$data-$protocol"
done
