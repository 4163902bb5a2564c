# make demo and make test are all that a person needs; both set up first what is missing.
PYTHON := .venv/bin/python
MESH   ?= demo/jacksboro_fault.npz
NAME    = $(basename $(notdir $(MESH)))

.PHONY: setup demo test lint clean
setup: .venv/ready

.venv/ready: pyproject.toml .ci/setup
	sh .ci/setup

demo: setup $(MESH)
	@mkdir -p demo
	.venv/bin/cdcp-igl map "$(MESH)" "demo/$(NAME)_disk.obj" --picture "demo/$(NAME)_disk.png"
	@echo
	@echo "The map, as texture coordinates: $(CURDIR)/demo/$(NAME)_disk.obj"
	@echo "The picture:                     $(CURDIR)/demo/$(NAME)_disk.png"

demo/jacksboro_fault.npz: | .venv/ready
	@mkdir -p demo
	$(PYTHON) -c 'import numpy, cdcp_igl.datasets as d; V, F = d.load("jacksboro_fault"); numpy.savez("$@", V=V, F=F)'

test: setup
	sh .ci/setup-browser
	$(PYTHON) -m pytest

lint: setup
	$(PYTHON) -m ruff check .
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m mypy

clean:
	rm -rf .venv demo build dist
