# make run    installs ctrlgen into .venv and solves, generates and compares the 20 um circle
# make test   installs ctrlgen with its test tools and runs the tests (minutes); make test-long runs them all (an hour)
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: run test test-long bench battery loop mutants docs schemas lint release clean

run: $(VENV)/installed
	$(BIN)/ctrlgen run scenarios/circle20 --out out/circle20

test: $(VENV)/installed-test
	$(BIN)/python -m pytest -n auto --dist loadfile -m "not long"

test-long: $(VENV)/installed-test
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test,docs,plant,recordings,dask,mutants]'
	$(BIN)/python -m benchmarks diagnosis --repeat 1
	$(BIN)/python -m pytest -n auto --dist worksteal

# make bench    times ctrlgen against named peers in the same run (minutes); REPEAT=1 is one round, NAMES="online job" these alone
REPEAT ?= 5
NAMES ?=
bench: $(VENV)/installed-test
	$(BIN)/python -m benchmarks $(NAMES) --repeat $(REPEAT)

# make battery SIZE=ci|small|full SEED=1: concealed cases (hours for full), diagnosed and scored; goes on where it was stopped
# CLASSES=messy,memory,null draws these classes alone
SIZE ?= small
SEED ?= 1
OPPONENTS ?= 4
CLASSES ?=
comma := ,
CONCEALED = out/battery_$(SIZE)_$(SEED)$(if $(CLASSES),_$(subst $(comma),_,$(CLASSES)))
battery: $(VENV)/installed-test
	test -e $(CONCEALED)/battery.json || $(BIN)/python -m battery make --out $(CONCEALED) --seed $(SEED) --size $(SIZE) --classes "$(CLASSES)"
	$(BIN)/python -m battery score $(CONCEALED) --run "$(BIN)/ctrlgen diagnose --jobs 0" --opponents $(OPPONENTS)

# make loop    the whole story on the independent plant: budget, diagnosis, calibration, learning, the fastest circle (ten minutes)
loop: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[plant]'
	$(BIN)/python -m plants.loop --out out/loop

# make docs    builds the documentation into out/docs; a warning, such as a dead link within it, is an error
docs: $(VENV)/installed-dev
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs out/docs
	@echo "documentation  out/docs/index.html"

# make mutants SAMPLE=100 SEED=1: wrong lines put in one at a time, each against the tests that see it (hours); docs/mutants.md
SAMPLE ?= 100
mutants: $(VENV)/installed-test
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test,mutants]'
	$(BIN)/python -m mutants --sample $(SAMPLE) --seed $(SEED) --out out/mutants

# make schemas    writes the JSON Schemas of the result files (budget.json and so on) from their models
schemas: $(VENV)/installed
	$(BIN)/python -m ctrlgen.app.write_schemas

# make release    builds dist/ from a clean tree, checks it, and runs the example with the wheel alone in a fresh environment;
# publishes nothing
FRESH := out/release
release:
	@test -z "$$(git status --porcelain)" || { echo "the tree is not clean: commit or set aside what git status lists"; exit 1; }
	rm -rf dist $(FRESH)
	$(PYTHON) -m venv $(FRESH)/tools
	$(FRESH)/tools/bin/python -m pip install --quiet --disable-pip-version-check build twine
	$(FRESH)/tools/bin/python -m build --outdir dist .
	$(FRESH)/tools/bin/python -m twine check --strict dist/*
	$(PYTHON) -m venv $(FRESH)/venv
	$(FRESH)/venv/bin/python -m pip install --quiet --disable-pip-version-check dist/*.whl
	cd $(FRESH) && venv/bin/ctrlgen --version && venv/bin/ctrlgen example circle20 --to scenarios && \
	  venv/bin/ctrlgen run scenarios/circle20 --out circle20
	@ls dist/*
	@echo "nothing was published: tag the commit v$$($(FRESH)/venv/bin/python -c 'import ctrlgen; print(ctrlgen.__version__)'), then twine upload dist/*"

lint: $(VENV)/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "ctrlgen needs Python 3.11 or newer; run: make PYTHON=/path/to/python3.11 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/installed: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	@touch $@

$(VENV)/installed-test: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test]'
	@touch $@ $(VENV)/installed

$(VENV)/installed-dev: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test,dev,docs]'
	@touch $@ $(VENV)/installed $(VENV)/installed-test

clean:
	rm -rf $(VENV) out build dist *.egg-info
