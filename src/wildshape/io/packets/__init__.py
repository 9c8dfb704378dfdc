# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of a sensor's own packets (.pcap, .pcapng). Start with `reader`."""
