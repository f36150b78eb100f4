# Every target creates its environment in $(VENV). Needs Python 3.11 or newer (with venv and pip) and make, nothing else.
#
#   make demo       optimise the hay press; report, figures and the new scene in out/hay-press
#   make test       the tests                      make test-all   also the slow ones
#   make check      format, lint, types, rules of the project
#   make format     format the sources             make bench      install the peers of the benchmarks
#   make docs       the documentation as a site in out/site
#   make release    wheel and source archive in dist, checked, and the tutorial by each of PYTHONS with the wheel alone
#   make pictures   renew the gallery and its pictures in docs
#   make clean      remove all created files
#
# PYTHON=python3.12 selects another interpreter; the environment is created again when its version changes.

PYTHON ?= python3
PYTHONS ?= python3.11 python3.12 python3.13
VENV ?= .venv
PYTEST_FLAGS ?= -n auto --maxprocesses 8 --dist loadfile --no-loadscope-reorder --nbmake

BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
# the version of the interpreter; empty if it is missing or too old
VERSION := $(shell $(PYTHON) -c 'import sys; v = sys.version_info; print("%d.%d.%d" % v[:3] if v >= (3, 11) else "")' 2>/dev/null)
MADE := $(VENV)/python-$(or $(VERSION),missing)
# the pages of the site, and the files that they link to
PAGES = README.md CHANGELOG.md CONTRIBUTING.md LICENSE docs studies notebooks tests/data/printed.json \
  linkjax/scenes/builtin linkjax/scenes/rolling linkjax/scenes/scene.schema.json

.PHONY: demo test test-all check format bench docs pictures release clean

demo: $(VENV)/demo.stamp
	$(BIN)/linkjax optimise hay-press --out out/hay-press

test: $(VENV)/test.stamp
	$(BIN)/python -m pytest $(PYTEST_FLAGS)

# programs optimised as users run them, and the types of all arguments; `make test` is faster without
test-all: $(VENV)/test.stamp
	XLA_FLAGS= $(BIN)/python -m pytest $(PYTEST_FLAGS) --jaxtyping-packages=linkjax,beartype.beartype -m ""

check: $(VENV)/test.stamp
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/python -m pytest --quiet tests/test_architecture.py

format: $(VENV)/test.stamp
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(VENV)/bench.stamp
	@echo "Ready: $(BIN)/python -m benchmarks.throughput"

pictures: $(VENV)/demo.stamp
	$(BIN)/python docs/pictures.py docs

docs: $(VENV)/docs.stamp
	rm -rf out/pages out/site
	mkdir -p out/pages
	tar --exclude=__pycache__ -cf - $(PAGES) | tar -xf - -C out/pages
	$(BIN)/python docs/pictures.py out/pages/docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "Ready: out/site/index.html"

release: $(VENV)/release.stamp
	rm -rf dist
	$(BIN)/python -m build --outdir dist
	$(BIN)/twine check --strict dist/*
	$(BIN)/python tests/release.py dist $(PYTHONS)

clean:
	rm -rf $(VENV) .cache .pytest_cache .ruff_cache dist out
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/demo.stamp: EXTRA :=
$(VENV)/test.stamp: EXTRA := [test]
$(VENV)/bench.stamp: EXTRA := [bench]
$(VENV)/docs.stamp: EXTRA := [docs]
$(VENV)/release.stamp: EXTRA := [release]
$(VENV)/%.stamp: $(MADE) pyproject.toml
	@echo "Installing linkjax$(EXTRA) into $(VENV): a minute or two the first time"
	$(PIP) --editable '.$(EXTRA)'
	@touch $@

$(MADE):
	@test -n "$(VERSION)" || { \
	  echo "linkjax needs Python 3.11 or newer, but '$(PYTHON)' is: $$($(PYTHON) --version 2>&1)."; \
	  echo "Name another one, e.g.: make $(or $(MAKECMDGOALS),demo) PYTHON=python3.12"; exit 1; } >&2
	$(PYTHON) -m venv --clear $(VENV)
	@touch $@
