# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which damage and which bombs belong to which kind of file."""

from collections.abc import Callable

from tests.fuzz import containers, documents, headers, tables
from tests.fuzz.mutations import Mutation

MUTATIONS: dict[str, tuple[Mutation, ...]] = {
    ".ply": (headers.change_header,),
    ".pcd": (headers.change_header,),
    ".npy": (headers.change_npy,),
    ".npz": (containers.change_zip,),
    ".las": (headers.change_las,),
    ".laz": (headers.change_las,),
    ".csv": (documents.change_table,),
    ".txt": (documents.change_table,),
    ".xyz": (documents.change_table,),
    ".json": (documents.change_json,),
    ".jsonl": (documents.change_json_lines,),
    ".gltf": (documents.change_json,),
    ".obj": (documents.change_table,),
    ".off": (documents.change_table,),
    ".xml": (documents.change_xml,),
    ".safetensors": (containers.change_safetensors,),
    ".glb": (containers.change_glb,),
    ".png": (containers.change_png,),
    ".pkl.gz": (containers.change_pickle, containers.change_pickle, containers.change_gzip),
    ".db3": (headers.change_cloud,),
    ".mcap": (headers.change_cloud,),
    ".bag": (headers.change_cloud,),
    ".json.gz": (containers.change_gzip,),
    ".feather": (tables.change_feather,),
    ".parquet": (tables.change_parquet, tables.change_footer),
}
BOMBS: dict[str, tuple[Callable[[], bytes], ...]] = {
    ".ply": (headers.empty_faces, headers.empty_faces_text),
    ".npz": (containers.zip_bomb, containers.wide_zip_bomb),
    ".pkl.gz": (containers.gzip_bomb,),
    ".png": (containers.png_bomb,),
    ".feather": (tables.feather_bomb,),
    ".parquet": (tables.parquet_bomb,),
    ".xml": (documents.laughs, documents.nested_xml),
    ".json": (documents.nested_json, documents.long_json),
    ".txt": (documents.long_line,),
    ".csv": (documents.long_line,),
    ".las": (headers.many_records,),
    ".laz": (headers.many_records,),
}


def mutations_of(suffix: str) -> tuple[Mutation, ...]:
    """What knows the format."""
    return MUTATIONS.get(suffix, ())


def bombs_of(suffix: str) -> tuple[Callable[[], bytes], ...]:
    """Small files that promise to become large ones."""
    return BOMBS.get(suffix, ())
