# flowloom: `make` lists the targets. Each recipe is one line that calls the command `flowloom`. That command decides by
# content (each folder's manifest.json) what is out of date, so figures are phony targets, and most runs end at once.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -O inherit_errexit -c
MAKEFLAGS += --no-builtin-rules --warn-undefined-variables
.DELETE_ON_ERROR:
.SUFFIXES:
.DEFAULT_GOAL := help

# An active Python environment of the user must not affect ours.
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

##@ Start
.PHONY: help demo test
help: ## this list
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

diff: $(STAMP) ## run every scene small and compare it with tests/references; exit 1 if one differs
	$(FLOWLOOM) diff

references: $(STAMP) ## replace tests/references by what the scenes give now (look at `make diff` first)
	$(FLOWLOOM) references

gallery: figures ## one page of all figures: out/gallery.html
	$(FLOWLOOM) gallery

farm: $(STAMP) ## one figure on several processes: make farm SCENE=scenes/ma09-fig01.toml WORKERS=4
	$(if $(SCENE),,$(error make farm needs SCENE=scenes/<figure>.toml))$(FLOWLOOM) farm $(SCENE) --workers $(WORKERS) $(OPTIONS)

bench: $(STAMP) ## measure speed and quality against targets, other programs and the papers: bench/RESULTS.md
	$(PYTHON) -m bench

##@ Development
.PHONY: setup doctor lint clean
setup: $(STAMP) ## system packages (root or sudo), the locked environment, the OpenVDB binding

$(STAMP): pipeline/setup.sh pyproject.toml uv.lock CMakeLists.txt pipeline/files/openvdb.cpp
	@pipeline/setup.sh

doctor: $(STAMP) ## check what a render needs: one line each, with what to do about what is missing
	$(FLOWLOOM) doctor

lint: $(STAMP) ## ruff and mypy
	.venv/bin/ruff check .
	.venv/bin/mypy

clean: ## remove all outputs (out), the environment and caches
	rm -rf out build .venv .cache
