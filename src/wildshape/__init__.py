# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Complete 3D shapes and 6-DoF poses of objects from one partial scan, without labels."""
