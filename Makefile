# A machine needs make and Python >= 3.11; every target does its own set-up into .venv first.
PYTHON ?= python3
VENV := .venv
PY := $(VENV)/bin/python
STAMP := $(VENV)/.installed
SIDE := build/side
PYTEST_WORKERS ?= 2

# One thread per process: the work is spread over processes, and nested thread pools fight for the same cores.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
export MPLBACKEND ?= Agg
# Else every process that a test starts compiles the text of the package anew, half a second each.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help install demo test pytest lint bench study study-cycles study-loop study-reliability study-second study-third study-fourth study-sequential study-fuzz study-import study-scale study-kill study-overnight study-damage study-foretold study-seeds study-sbc study-modes study-beside study-growth study-long clean

help:
	@echo "make demo     the main job on the data that ships; prints where the report lies"
	@echo "make test     style, types, floors and tests"
	@echo "make bench    the table of solver times, and of what a curve costs in use"
	@echo "make study    statistical studies, minutes to hours"
	@echo "make study-loop  diagnosis of synthetic faults, an hour or two; goes on where it was; LOOP='--limit 130' asks for less"
	@echo "make study-cycles  real cyclic tests with each energy declared and with none, an hour or so; goes on where it was; CYCLES='--declare none' asks for less"
	@echo "make study-reliability  are probabilities frequencies; hours; goes on where it was; RELIABILITY='--count 60' asks for less"
	@echo "make study-second  the same on the second generator, once and at the end; SECOND='--count 60' asks for less"
	@echo "make study-third  the same on the third generator, 120 cases a seed; hours; goes on where it was; THIRD='--seed 7 --count 60' asks for less"
	@echo "make study-fourth  the same on the fourth generator, 60 cases a seed; an hour; goes on where it was; FOURTH='--seed 7 --count 20' asks for less"
	@echo "make study-sequential  ambiguous answers, the tests that they propose made, and diagnosed again; hours; goes on where it was; SEQUENTIAL='--count 20' asks for less"
	@echo "make study-fuzz  500 calls at random, each judged, an hour or so; goes on where it was; FUZZ='--only fit' asks for less"
	@echo "make study-scale  ten thousand tiny runs in a campaign, some minutes: what it costs beside the work itself"
	@echo "make study-kill  runs killed at random moments and while they write, and a campaign of 60 runs, some minutes; KILL='--kills 20' asks for less"
	@echo "make study-overnight  what checkpoints cost, the memory of ten million draws, how late a deadline is, some minutes"
	@echo "make study-damage  every stored file damaged 500 times, an hour or less; DAMAGE='--times 50' asks for less"
	@echo "make study-foretold  what dry runs foretell beside what six campaigns take, a quarter of an hour"
	@echo "make study-import 10 000 damaged exports, what becomes of them, some minutes; IMPORT='--count 1000' asks for less"
	@echo "make study-seeds 50 seeds for the statistical tests, lanes on and off, hours; goes on where it was; SEEDS='--group quick' asks for less"
	@echo "make study-sbc  simulation-based calibration of every material, hours; goes on where it was; SBC='--only gent --limit 20' asks for less"
	@echo "make study-modes four rubbers in several modes each, half an hour or so; goes on where it was; MODES='--evidence-on none' asks for less"
	@echo "make study-beside  other samplers and FElupe beside this package, in an environment of their own, an hour or so; goes on where it was; BESIDE='--materials gent' asks for less"
	@echo "make study-long  an export of 200 000 rows through every verb: seconds of a processor, and memory; some minutes"
	@echo "make study-growth  CPU seconds against readings, walkers, parameters, specimens, a quarter of an hour or so; goes on where it was; GROWTH='--only readings' asks for less"
	@echo "make pytest   tests alone"
	@echo "make install  the set-up alone, into $(VENV)"
	@echo "make lint     style, types and floors alone"
	@echo "make clean    remove caches and build products; keeps $(VENV), chains and reports"

install: $(STAMP)

# The build tools are installed first and pinned too, so that nothing unpinned is fetched behind the scenes.
$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "bayesmembrane needs Python >= 3.11, and '$(PYTHON)' is $$($(PYTHON) --version 2>&1 || true);" \
	       "name a newer one: make PYTHON=python3.12 $(MAKECMDGOALS)" >&2; exit 1; }
	@test -x $(PY) || $(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); \
	  echo "'$(PYTHON)' cannot make a virtual environment; install its venv module (Debian: apt install python3-venv)" >&2; exit 1; }
	$(PY) -m pip install --quiet --disable-pip-version-check --constraint constraints.txt hatchling editables
	$(PY) -m pip install --quiet --disable-pip-version-check --constraint constraints.txt \
	  --no-build-isolation --editable '.[test]'
	$(PY) -m bayesmembrane.app.precompile
	@touch $(STAMP)

demo: $(STAMP)
	$(VENV)/bin/bayesmembrane demo

# Style and types are one process: a core that would wait for them runs tests instead. Either failure is one.
test: $(STAMP)
	@$(MAKE) --no-print-directory -j 2 lint pytest

pytest: $(STAMP)
	$(PY) -m pytest -n $(PYTEST_WORKERS) --dist loadfile --no-loadscope-reorder

lint: $(STAMP)
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m mypy
	$(VENV)/bin/lint-imports

bench: $(STAMP)
	$(PY) -m tests.benchmarks.bench
	$(PY) -m tests.benchmarks.in_use

study: $(STAMP)
	$(PY) -m pytest -n $(PYTEST_WORKERS) -m study

study-loop: $(STAMP)
	$(PY) -m tests.studies.loop_study --jobs $(PYTEST_WORKERS) $(LOOP)

study-cycles: $(STAMP)
	$(PY) -m tests.studies.cycles $(CYCLES)

# Pages in docs/studies say in words what was seen of one seed: tables are written beside the results instead.
study-reliability: $(STAMP)
	$(PY) -m tests.studies.reliability --jobs $(PYTEST_WORKERS) --table reports/study-reliability/reliability.md $(RELIABILITY)

study-second: $(STAMP)
	$(PY) -m tests.studies.reliability --generator second --jobs $(PYTEST_WORKERS) --table reports/study-reliability/second.md $(SECOND)

study-third: $(STAMP)
	$(PY) -m tests.studies.reliability --generator third --jobs $(PYTEST_WORKERS) --table reports/study-reliability/third.md $(THIRD)

study-fourth: $(STAMP)
	$(PY) -m tests.studies.reliability --generator fourth --jobs $(PYTEST_WORKERS) --table reports/study-reliability/fourth.md $(FOURTH)

study-sequential: $(STAMP)
	$(PY) -m tests.studies.sequential --table docs/studies/sequential.md $(SEQUENTIAL)

study-fuzz: $(STAMP)
	$(PY) -m tests.fuzz.run --jobs $(PYTEST_WORKERS) --table docs/studies/fuzz.md $(FUZZ)

study-scale: $(STAMP)
	$(PY) -m tests.studies.scale --table docs/studies/scale.md $(SCALE)

study-kill: $(STAMP)
	$(PY) -m tests.studies.kill --table docs/studies/kill.md $(KILL)
	$(PY) -m tests.studies.kill_campaign --table docs/studies/kill_campaign.md

study-overnight: $(STAMP)
	$(PY) -m tests.studies.overnight --table docs/studies/overnight.md $(OVERNIGHT)

study-damage: $(STAMP)
	$(PY) -m tests.studies.damage --table docs/studies/damage.md $(DAMAGE)

study-foretold: $(STAMP)
	$(PY) -m tests.studies.foretold --table docs/studies/foretold.md

study-import: $(STAMP)
	$(PY) -m tests.studies.imports --table docs/studies/import.md $(IMPORT)

study-seeds: $(STAMP)
	$(PY) -m tests.studies.seeds $(SEEDS)

study-sbc: $(STAMP)
	$(PY) -m tests.studies.sbc --jobs $(PYTEST_WORKERS) --table docs/studies/sbc.md $(SBC)

study-modes: $(STAMP)
	$(PY) -m tests.studies.modes $(MODES)

# What is compared with stays out of $(VENV). UltraNest may come as source, which cython, setuptools and a C compiler build.
$(SIDE)/.installed: tests/studies/side_by_side.txt constraints.txt pyproject.toml
	@test -x $(SIDE)/bin/python || $(PYTHON) -m venv $(SIDE)
	$(SIDE)/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt \
	  hatchling editables cython setuptools numpy
	$(SIDE)/bin/python -m pip install --quiet --disable-pip-version-check --no-build-isolation \
	  --requirement tests/studies/side_by_side.txt --editable .
	@touch $@

study-beside: $(SIDE)/.installed
	$(SIDE)/bin/python -m tests.studies.side_by_side --table docs/studies/side_by_side.md $(BESIDE)

study-long: $(STAMP)
	$(PY) -m tests.studies.long_files --table docs/studies/long_files.md

study-growth: $(STAMP)
	$(PY) -m tests.studies.growth --table docs/studies/growth.md $(GROWTH)

clean:
	rm -rf build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find bayesmembrane tests -name __pycache__ -type d -prune -exec rm -rf {} +
