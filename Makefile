# flowloom: `make` shows what there is. Each recipe is one line that calls the command `flowloom`; what is stale is
# decided there, by content (each folder's manifest.json), so a figure is always asked and mostly answers at once.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -O inherit_errexit -c
MAKEFLAGS += --no-builtin-rules --warn-undefined-variables
.DELETE_ON_ERROR:
.SUFFIXES:
.DEFAULT_GOAL := help

# An active environment of the user's must not reach into ours.
unexport PYTHONPATH PYTHONHOME VIRTUAL_ENV

QUICK ?=
WORKERS ?= $(shell nproc)
SCENE ?=
PYTEST ?=

FLOWLOOM := .venv/bin/flowloom
PYTHON := .venv/bin/python
STAMP := .venv/flowloom.stamp
FIGURES := $(patsubst scenes/%.toml,%,$(wildcard scenes/*.toml))
OPTIONS := $(if $(QUICK),--quick)

##@ First
.PHONY: help demo test
help: ## this page
	@awk 'BEGIN { FS = ":.*## " } /^##@/ { printf "\n%s\n", substr($$0, 5) } \
		/^[a-z][^:]*:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))
	@printf '\nFigures (make QUICK=1 <figure>: small and fast, in out/quick)\n'
	@printf '  make %s\n' $(FIGURES)

demo: ma09-fig01 ## set up, then figure 1 of ma09: heart-shaped swirls in smoke
	@echo "the figure: $(if $(QUICK),out/quick,out)/ma09-fig01/ma09-fig01.png"

test: lint ## set up, then every test
	$(PYTHON) -m pytest $(PYTEST)

##@ Pictures
.PHONY: figures $(FIGURES) diff references gallery farm bench
figures: $(FIGURES) ## every figure

$(FIGURES): $(STAMP)
	$(FLOWLOOM) figure scenes/$@.toml $(OPTIONS)

diff: $(STAMP) ## render the proof frames anew and compare them with tests/references; exit 1 if they differ
	$(FLOWLOOM) diff

references: $(STAMP) ## write tests/references anew (look at `make diff` first)
	$(FLOWLOOM) references

gallery: figures ## one page of all figures: out/gallery.html
	$(FLOWLOOM) gallery

farm: $(STAMP) ## one figure by several processes: make farm SCENE=scenes/ma09-fig01.toml WORKERS=4
	$(if $(SCENE),,$(error make farm needs SCENE=scenes/<figure>.toml))$(FLOWLOOM) farm $(SCENE) --workers $(WORKERS) $(OPTIONS)

bench: $(STAMP) ## speed and quality, side by side with references and the papers
	$(PYTHON) -m bench

##@ The house
.PHONY: setup doctor lint clean
setup: $(STAMP) ## system packages (root or sudo), the locked environment, the OpenVDB binding

$(STAMP): pipeline/setup.sh pyproject.toml uv.lock CMakeLists.txt pipeline/files/openvdb.cpp
	@pipeline/setup.sh

doctor: $(STAMP) ## try what a render needs; one line each says what was found and how to mend what is not
	$(FLOWLOOM) doctor

lint: $(STAMP) ## ruff and mypy
	.venv/bin/ruff check .
	.venv/bin/mypy

clean: ## remove what was made: pictures and fields (out), the environment, caches
	rm -rf out build .venv .cache
