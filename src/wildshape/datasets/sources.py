# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Names of the data sets that can be converted, and what reads them.

To add a reader (see `datasets.tracks.source.Source`): one line in `SOURCES`, in the order in
which the help is to list them. Its own options are fields of the command's `Settings`, with the
names of fields of the reader or of its records; whoever passes one to a reader that lacks it is
told so.
"""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin, get_type_hints

from wildshape.arguments import as_path
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.datasets.tracks.source import Source

_NO_OPTIONS: Mapping[str, Any] = MappingProxyType({})

SOURCES = {
    "kitti-raw": "wildshape.datasets.kitti.raw:KittiRaw",
    "kitti-tracking": "wildshape.datasets.kitti.tracking:KittiTracking",
    "semantic-kitti": "wildshape.datasets.semantic_kitti.reader:SemanticKitti",
    "nuscenes": "wildshape.datasets.nuscenes.reader:NuScenes",
    "argoverse2": "wildshape.datasets.argoverse2.reader:Argoverse2",
    "waymo": "wildshape.datasets.waymo.reader:Waymo",
    "pandaset": "wildshape.datasets.pandaset.reader:PandaSet",
    "shapenet-views": "wildshape.datasets.shapenet.reader:ShapeNetViews",
    "rgbd": "wildshape.datasets.rgbd.reader:Rgbd",
    "bop": "wildshape.datasets.rgbd.bop:Bop",
    "folder": "wildshape.datasets.tracks.whole_tracks:Folder",
    "packed": "wildshape.datasets.tracks.whole_tracks:Packed",
}
"""Name on the command line -> module and class; imported when it is asked for."""


def open_source(name: str, root: Path | str, options: Mapping[str, Any] = _NO_OPTIONS) -> "Source":
    """The reader of a data set of `SOURCES`, with its own defaults where nothing else is wanted.

    `options`: values for the fields of the reader or of its records (`Selection`, `Crop`).

    Raises:
        BadInputError: no such source, or an option that it does not have.
    """
    if name not in SOURCES:
        raise BadInputError(
            f"'{name}' is no source that can be converted; there are {', '.join(SOURCES)}."
        )
    module, _, kind = SOURCES[name].partition(":")
    source = getattr(import_module(module), kind)(as_path(root, "root"))
    for option, value in options.items():
        source = _with(source, name, option, value)
    return source


def _with(source: Any, name: str, option: str, value: object) -> Any:
    """The reader with one option set, wherever among its records the option belongs."""
    own = _settable(source)
    if option == "keep_ground" and "crop" in own:
        return replace(source, crop=replace(source.crop, ground=-source.crop.margin))
    if option in own:
        return replace(source, **{option: _checked(source, option, value)})
    for group in own:
        record = getattr(source, group)
        if option in _settable(record):
            changed = replace(record, **{option: _checked(record, option, value)})
            return replace(source, **{group: changed})
    raise BadInputError(f"--{option.replace('_', '-')}: {name} has no such option; leave it out.")


def _settable(record: Any) -> list[str]:
    return [field.name for field in fields(record) if field.init] if is_dataclass(record) else []


def _checked(record: Any, option: str, value: object) -> object:
    """The value, if the field's type lists the words it may be."""
    hint = get_type_hints(type(record))[option]
    if get_origin(hint) is Literal and value not in get_args(hint):
        expected = ", ".join(map(str, get_args(hint)))
        raise BadInputError(f"--{option.replace('_', '-')} {value}: expected one of {expected}.")
    return value
