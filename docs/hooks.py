# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""For MkDocs: links that leave docs/ lead to copies, and the commands' help becomes a page."""

import os
import re
import subprocess
import sys
from pathlib import Path
from posixpath import dirname, join, normpath, relpath
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

_RESULTS = (
    "shipped-weights",
    "real-boxes",
    "drive",
    "depth-views",
    "demo",
    "paper-tables",
    "speed",
)
COPIES = "repository"  # where files from outside of docs/ lie on the site
WRITTEN = (
    "benchmarks/RESULTS.md",
    *(f"benchmarks/results/{name}.md" for name in _RESULTS),
    "CHANGELOG.md",
    "CONTRIBUTING.md",
)
HELP = "commands.md"
_LINK = re.compile(r"(\]\()([^)#\s]+)((?:#[^)]*)?\))")
_FENCE = re.compile(r"(^```.*?^```)", re.DOTALL | re.MULTILINE)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages from outside of docs/, whatever is linked from any page, and the help."""
    root = dirname(config.config_file_path)
    pages = {f"docs/{page.src_uri}": page.content_string for page in files.documentation_pages()}
    pages |= {path: Path(root, path).read_text(encoding="utf-8") for path in WRITTEN}
    linked = {to for path, text in pages.items() for to in _outside(path, text)}
    for path in sorted(linked | set(WRITTEN)):
        if Path(root, path).is_file():
            files.append(_generated(config, f"{COPIES}/{path}", join(root, path)))
    files.append(File.generated(config, HELP, content=commands()))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Point links that leave docs/, or that come back from outside, at the site's own files."""
    place = page.file.src_uri
    path = place.removeprefix(f"{COPIES}/") if place.startswith(COPIES) else f"docs/{place}"
    parts = _FENCE.split(markdown)
    parts[::2] = [_LINK.sub(lambda m: _moved(m, path, place), part) for part in parts[::2]]
    return "".join(parts)


def _moved(match: re.Match[str], path: str, place: str) -> str:
    head, target, tail = match.groups()
    if ":" in target:
        return match[0]
    goal = normpath(join(dirname(path), target))
    goal = goal.removeprefix("docs/") if goal.startswith("docs/") else f"{COPIES}/{goal}"
    return f"{head}{relpath(goal, dirname(place) or '.')}{tail}"


def _outside(path: str, text: str) -> set[str]:
    """Files outside of docs/ that a page links to."""
    targets = {target for _, target, _ in _LINK.findall(_FENCE.sub("", text)) if ":" not in target}
    goals = {normpath(join(dirname(path), target)) for target in targets}
    return {goal for goal in goals if not goal.startswith(("docs/", ".."))}


def _generated(config: MkDocsConfig, uri: str, path: str) -> File:
    return File.generated(config, uri, abs_src_path=path)


def commands() -> str:
    """What `wildshape COMMAND --help` says, of all commands."""
    from wildshape.cli.main import COMMANDS

    said = ["# Commands", "Exit code 0: done; 2: bad input, one sentence on stderr."]
    for name in ("", *COMMANDS):
        said += [f"## {name}", f"{COMMANDS[name][0].upper()}{COMMANDS[name][1:]}."] if name else []
        said.append(f"```text\n{_help(name)}\n```")
    return "\n\n".join(said) + "\n"


def _help(command: str) -> str:
    words = [sys.executable, "-m", "wildshape.cli", *command.split(), "--help"]
    environment = {**os.environ, "COLUMNS": "88", "NO_COLOR": "1", "TERM": "dumb"}
    run = subprocess.run(words, check=True, capture_output=True, text=True, env=environment)
    return run.stdout.strip()
