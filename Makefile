# make demo and make test are all that a person needs; both set up first what is missing.
PYTHON := .venv/bin/python
MESH   ?= demo/jacksboro_fault.npz
export MESH

.PHONY: setup demo test test-quick test-kernels test-lowest lint bench docs dist clean
setup: .venv/ready

.venv/ready: pyproject.toml .ci/setup
	sh .ci/setup

demo: setup
	@sh .ci/demo

# File by file, as the tests of a file share what they have measured.
test: setup
	$(PYTHON) -m pytest -n auto --dist loadfile

# Without what takes long.
test-quick: setup
	$(PYTHON) -m pytest -n auto --dist loadfile -m 'not slow'

# The quick tests as other machines round: under the kernels of OpenBLAS that this processor can
# run. On systems without /proc/cpuinfo it runs none.
test-kernels: setup
	@for kernel in pni:Prescott avx2:Haswell avx512vl:SkylakeX; do \
	    grep -qsw $${kernel%:*} /proc/cpuinfo || continue; \
	    echo "== OPENBLAS_CORETYPE=$${kernel#*:}"; \
	    OPENBLAS_CORETYPE=$${kernel#*:} \
	        $(PYTHON) -m pytest -n auto --dist loadfile -m 'not slow' || exit; \
	done

# The quick tests with the lowest version of each dependency that pyproject.toml allows. What these
# call may be deprecated in the packages that they need themselves, which are the newest.
test-lowest: setup
	$(PYTHON) -m venv --clear build/lowest
	build/lowest/bin/python -m pip install --quiet uv
	build/lowest/bin/uv pip install --quiet --python build/lowest --resolution lowest-direct \
	    --editable '.[dev,scikit-sparse]'
	build/lowest/bin/python -m pytest -n auto --dist loadfile -m 'not slow' \
	    -W ignore::DeprecationWarning

lint: setup
	$(PYTHON) -m ruff check .
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m mypy

# What benchmarks/results has. What is measured already is kept. Times come
# first, alone; then two cases run side by side, and theirs are a hint.
bench: setup
	$(PYTHON) -m benchmarks speed --repeats 3 --out benchmarks/results
	for command in tables 'tables --tier standard' ablation peers; do \
	    $(PYTHON) -m benchmarks $$command --jobs 2 --time-limit 60 --out benchmarks/results || exit; \
	done
	$(PYTHON) -m benchmarks surfaces --jobs 2 --out benchmarks/results/surfaces.md
	$(PYTHON) -m benchmarks figures --out benchmarks/results
	$(PYTHON) -m benchmarks readme

# The pages, into docs/build/html; a warning, a broken link or what does not fit a screen is an
# error. From scratch, as their pictures and outputs depend on the whole package.
docs: .venv/docs
	rm -rf docs/build docs/gallery docs/generated
	$(PYTHON) -m sphinx -W --keep-going -n -q -b html docs docs/build/html
	$(PYTHON) docs/check_links.py docs/build/html
	$(PYTHON) docs/check_pages.py docs/build/html

.venv/docs: .venv/ready
	$(PYTHON) -m pip install --quiet --editable '.[docs]'
	@touch $@

# What is released: built, checked, and the wheel tried in an empty environment, where no extra has
# brought a solver under the GPL, with the first lines of README on two files, one with seams.
dist: .venv/docs
	rm -rf dist build/empty
	$(PYTHON) -m build
	$(PYTHON) -m twine check --strict dist/*
	$(PYTHON) -m venv build/empty
	build/empty/bin/python -m pip install --quiet --only-binary :all: dist/*.whl
	cd build/empty && bin/python -c 'import cdcp_igl; \
	    cdcp_igl.disk_map(*cdcp_igl.datasets.spherical_cap(60)[:2]).save("face.obj"); \
	    cdcp_igl.surface_map(*cdcp_igl.datasets.spheroid(4)[:2]).save("statue.glb")'
	cd build/empty && (sed -n '/^```python/,/^```/ { /^>>>/q; /^```/!p }' ../../README.md; \
	    echo 'print(cdcp_igl.disk_map("face.obj"), atlas)') | bin/python -

clean:
	rm -rf .venv demo build dist docs/build docs/gallery docs/generated
