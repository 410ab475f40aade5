# NAISR Atlas Explorer; `make help` lists what can be done.
#
#   PYTHON    the Python, 3.11 or newer, that .venv is made from
#   TORCH_INDEX  where torch comes from; by default PyTorch's index of CPU builds on a Linux machine
#             without an NVIDIA driver (the usual build brings several GB of CUDA), else pip's own index
#   PIP_ARGS  more arguments for every `pip install`
#   WORKERS   processes that run the tests, about 2 GB each

SHELL := /bin/bash
PYTHON ?= python3
PIP_ARGS ?=
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# Progress bars are for people; a log gets errors only.
PIP := $(BIN)/python -m pip install --disable-pip-version-check $(if $(MAKE_TERMOUT),,--quiet)
PYTEST_ARGS ?=
WORKERS ?= 2

ifeq ($(shell uname),Linux)
ifeq ($(shell command -v nvidia-smi),)
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu
endif
endif

TORCH_ARGS = --no-deps $(if $(TORCH_INDEX),--retries 1 --timeout 15 --index-url $(TORCH_INDEX)) $(PIP_ARGS)

# What Qt 6, VTK and a virtual display need of the system: library or program = Debian package.
SYSTEM_NEEDS := \
	Xvfb=xvfb xauth=xauth \
	libEGL.so.1=libegl1 libdbus-1.so.3=libdbus-1-3 libfontconfig.so.1=libfontconfig1 \
	libglib-2.0.so.0=libglib2.0-0 libxcb-cursor.so.0=libxcb-cursor0 libxcb-icccm.so.4=libxcb-icccm4 \
	libxcb-keysyms.so.1=libxcb-keysyms1 libxcb-shape.so.0=libxcb-shape0 \
	libxkbcommon-x11.so.0=libxkbcommon-x11-0 libXcursor.so.1=libxcursor1

.DEFAULT_GOAL := help
.PHONY: help env system run test fuzz figures lint lock clean

help: ## say what can be done
	@sed -n 's/^\([a-z]*\):.*## /  make \1\t/p' $(MAKEFILE_LIST) | expand -t 16

env: $(STAMP) ## make .venv with everything installed (cheap when nothing changed)

$(STAMP): pyproject.toml requirements.lock
	@$(MAKE) --no-print-directory system
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "$(PYTHON) is $$($(PYTHON) -V 2>&1), but 3.11 or newer is needed:" \
	    "make env PYTHON=/path/to/python3.11" >&2; exit 1; }
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv $(VENV)
	@echo "Installing the libraries into $(VENV): about 3 GB, a few minutes the first time ..."
ifneq ($(TORCH_INDEX),)
	@$(PIP) $(TORCH_ARGS) "$$(grep '^torch==' requirements.lock)" || \
	  echo "$(TORCH_INDEX) has no torch for us; using pip's own index."
endif
	@$(PIP) $(PIP_ARGS) -r requirements.lock
	@$(PIP) $(PIP_ARGS) --no-deps -e .
	@touch $@

# Installs what is missing where apt can; elsewhere says in one sentence what is missing.
system:
ifeq ($(shell uname),Linux)
	@missing=""; packages=""; \
	libraries="$$(PATH="$$PATH:/usr/sbin:/sbin" ldconfig -p 2>/dev/null || true)"; \
	for need in $(SYSTEM_NEEDS); do \
	  name=$${need%%=*}; \
	  command -v "$$name" >/dev/null || grep -qF "$$name " <<<"$$libraries" || \
	    { missing+=" $$name"; packages+=" $${need#*=}"; }; \
	done; \
	if ! command -v $(PYTHON) >/dev/null; then \
	  missing+=" $(PYTHON)"; packages+=" $(PYTHON) $(PYTHON)-venv"; \
	elif ! $(PYTHON) -c 'import ensurepip, venv' 2>/dev/null; then \
	  missing+=" python-venv"; \
	  packages+=" $$($(PYTHON) -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')"; \
	fi; \
	if [ -z "$$missing" ]; then exit 0; fi; \
	root=""; if [ "$$(id -u)" != 0 ]; then root="$$(command -v sudo || echo none)"; fi; \
	if command -v apt-get >/dev/null && [ "$$root" != none ]; then \
	  echo "Installing system packages:$$packages"; \
	  $$root apt-get update -qq || true; \
	  $$root env DEBIAN_FRONTEND=noninteractive \
	    apt-get install -qq -y --no-install-recommends $$packages >/dev/null && exit 0; \
	fi; \
	echo "This system lacks$$missing (on Debian and Ubuntu: apt-get install$$packages). Install that and" \
	  "run make again, or go on without it: make env SYSTEM_NEEDS=" >&2; exit 1
endif

run: env ## open the viewer; without a display, write pictures and meshes into out/
	@if [ "$$(uname)" != Linux ] || [ -n "$${DISPLAY:-}$${WAYLAND_DISPLAY:-}" ]; then \
	  exec $(BIN)/naisr-viewer; \
	fi; \
	echo "No display here: showing the window on a virtual one and moving every slider ..."; \
	xvfb-run -a -s "-screen 0 1600x1000x24" $(BIN)/naisr-viewer --demo out && \
	  echo "Screenshots and exported meshes are in $(CURDIR)/out"

test: lint ## check format, style and types, then run the tests
	@$(BIN)/pytest --numprocesses $(WORKERS) --dist worksteal $(PYTEST_ARGS)

fuzz: env ## try broken inputs of every kind, some minutes, and count in the results how they end
	@$(BIN)/pytest -m fuzz tests/corpus --counts resources/docs/results.md $(PYTEST_ARGS)

figures: env ## make the pictures of the window in the documents anew
	@$(BIN)/python -m naisr_viewer.program.figures resources

lint: env ## check format, style and types
	@$(BIN)/ruff format --check .
	@$(BIN)/ruff check .
	@$(BIN)/mypy

lock: ## write requirements.lock anew from the ranges in pyproject.toml; torch stays where it is
	@fresh="$$(mktemp -d)"; trap 'rm -rf "$$fresh"' EXIT; set -e; \
	$(PYTHON) -m venv "$$fresh"; \
	"$$fresh/bin/python" -m pip install --quiet $(TORCH_ARGS) "$$(grep '^torch==' requirements.lock)"; \
	"$$fresh/bin/python" -m pip install --quiet $(PIP_ARGS) '.[test,bodies,cluster]'; \
	{ sed -n '/^#/p' requirements.lock; \
	  "$$fresh/bin/python" -m pip freeze --all --exclude pip --exclude naisr-atlas-explorer | \
	    sed -e '/^\(nvidia\|cuda\|triton\)/d' -e 's/+[a-z0-9]*$$//'; \
	} > requirements.lock.new; \
	mv requirements.lock.new requirements.lock

clean: ## remove .venv, caches and builds
	rm -rf $(VENV) build dist .mypy_cache .pytest_cache .ruff_cache
	find naisr_model naisr_viewer tests -name __pycache__ -type d -prune -exec rm -rf {} +
