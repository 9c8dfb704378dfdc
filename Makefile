# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
#
#   make demo [DATA=folder]   the whole way in five minutes, ending in demo/report.html
#   make test                 lint, types, import layers, tests
#   make check                the first three alone; not repeated where no Python file has changed
#   make bench                everything timed beside the alternatives, in five minutes; all bars
#   make smoke                every benchmark at its smallest: whether it runs and agrees, no times
#   make fuzz                 20,000 damaged files for all readers, in three minutes
#   make wheel                wheels built, installed in fresh environments, tried
#   make docs                 the site of docs/, in site/index.html
#
# Each sets up .venv by itself and needs python >= 3.11 with venv; a C compiler makes it faster.
# No GPU in a Linux machine? PyPI's torch may bring 2 GB of CUDA along; this takes the CPU build:
#   make demo PIP_ARGS="--extra-index-url https://download.pytorch.org/whl/cpu"

# 3.14 comes last: two libraries have no wheels for it yet and are compiled, if they can be.
CANDIDATES := python3 python3.13 python3.12 python3.11 python3.14
NEW_ENOUGH := import sys; sys.exit(sys.version_info < (3, 11))
WITH_WHEELS := import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))
PYTHON ?= $(shell for check in '$(WITH_WHEELS)' '$(NEW_ENOUGH)'; do for p in $(CANDIDATES); do \
	$$p -c "$$check" 2>/dev/null && { echo $$p; exit; }; done; done)
PIP_ARGS ?=
DATA ?=
OUT ?= demo

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check -qq install $(PIP_ARGS) -c constraints.txt
# pip compiles modules on one core. Some that libraries carry are for other versions of python. The
# whole path: a relative one would be put right at each import, at a cost of memory.
COMPILE := $(BIN)/python -m compileall -qq -j 0 $(abspath $(VENV))/lib
ALL := .[test,bench,docs]
INSTALL = $(PIP) --no-compile -e "$(1)" && { $(COMPILE) || :; }
INSTALLED := $(VENV)/.installed
TESTED := $(VENV)/.installed-test
BENCHED := $(VENV)/.installed-bench
DOCUMENTED := $(VENV)/.installed-docs
CHECKED := $(VENV)/.checked
# Folders are watched, too: a file that is gone changes what others mean.
PYTHONS := $(shell find .ci/ benchmarks/ docs/ examples/ experiments/ src/ tests/ hatch_build.py \
	-name __pycache__ -prune -o \( -name '*.py' -o -type d \) -print)
# The package is installed in place: only these make another installation necessary.
SOURCES := pyproject.toml constraints.txt hatch_build.py $(wildcard src/wildshape/ops/native/*.[ch])

.PHONY: demo test check bench smoke fuzz wheel docs installed clean
.DELETE_ON_ERROR:

demo: $(INSTALLED)
	$(BIN)/wildshape demo --out "$(OUT)" --overwrite $(if $(DATA),--data "$(DATA)")

test: $(TESTED) $(CHECKED)
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

check: $(CHECKED)

$(CHECKED): $(TESTED) $(PYTHONS)
	$(BIN)/ruff format --check --quiet .
	$(BIN)/ruff check --quiet .
	$(BIN)/basedpyright
	$(BIN)/lint-imports
	@touch $@

bench: $(BENCHED)
	@$(BIN)/python benchmarks/run.py

smoke: $(BENCHED)
	@$(BIN)/python benchmarks/run.py --smoke

fuzz: $(TESTED)
	@$(BIN)/python tests/fuzz/run.py --inputs 20000 --workers 2

wheel: $(TESTED)
	$(BIN)/python .ci/wheel.py

docs: $(DOCUMENTED)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

$(BIN)/python:
	@test -n "$(PYTHON)" || { \
		echo "Wildshape needs python >= 3.11, and none of $(CANDIDATES) is: install one, or name" \
			"it: make PYTHON=/path/to/python" >&2; exit 1; }
	@$(PYTHON) -c '$(NEW_ENOUGH)' || { \
		echo "Wildshape needs python >= 3.11, and $(PYTHON) is older or missing." >&2; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); \
		echo "$(PYTHON) cannot make a virtual environment: its venv module is missing; install it" \
			"(Debian and Ubuntu: python3-venv), or name another: make PYTHON=..." >&2; exit 1; }
	@$(PIP) --upgrade pip # the one that python brings may be years old, and takes twice as long

define ANNOUNCED
echo "installing into $(VENV), once; this takes a few minutes"
command -v "$${CC:-cc}" >/dev/null || \
	echo "no C compiler found: Wildshape works without its native kernels, slower" >&2
endef

$(INSTALLED): $(SOURCES) | $(BIN)/python
	@$(ANNOUNCED)
	@$(call INSTALL,.)
	@touch $@

$(TESTED): $(INSTALLED)
	@$(call INSTALL,.[test])
	@touch $@

$(BENCHED): $(INSTALLED)
	@$(call INSTALL,.[bench])
	@touch $@

$(DOCUMENTED): $(INSTALLED)
	@$(call INSTALL,.[docs])
	@touch $@

# All at once: what CI needs is resolved and built once.
installed: $(SOURCES) | $(BIN)/python
	@$(ANNOUNCED)
	@$(call INSTALL,$(ALL))
	@touch $(INSTALLED) $(TESTED) $(BENCHED) $(DOCUMENTED)

clean:
	rm -rf $(VENV) "$(OUT)" site
