#!/bin/sh
# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
#
# Is it a lottery over seeds? Three seeds of `small`, trained for STEPS steps on 300 simulated tracks,
# measured on 30 others under random yaw; mean, deviation, and the seed chosen without labels.
#
#   experiments/seeds.sh OUT [STEPS]
set -eu
out=$1 steps=${2:-800}
mkdir -p "$out"
wildshape simulate "$out/train" --tracks 300 --seed 1
wildshape simulate "$out/test" --tracks 30 --seed 9001
for seed in 0 1 2; do
    wildshape train "$out/train" --out "$out/seed$seed" --preset small --steps "$steps" --seed "$seed"
done
wildshape evaluate "$out/test" --out "$out/evaluation" --rotate yaw --max-scans 12 --as-seeds \
    --baselines identity,one-scan,local-icp \
    --model "$out/seed0" "$out/seed1" "$out/seed2"
