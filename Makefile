# `make help` lists what can be made. On a fresh Debian 12 machine every target first installs what is missing.

SCENE ?= scenes/paper.toml
OUT ?= runs/$(patsubst %.toml,%,$(shell basename '$(SCENE)'))
JOBS ?= 2

PYTHON := .venv/bin/python
INSTALL := $(PYTHON) -m pip install --quiet --disable-pip-version-check
PACKAGES := liggghts libliggghts-dev libopenmpi-dev zlib1g-dev g++ make
# Packages are walked; those that name what they export have their modules listed.
MODULES := $(subst /,.,$(filter-out %__init__ %__main__,$(basename $(wildcard $(foreach name,analysis dem plate_fem recognition,$(name)/*.py $(name)/*/*.py)))))
SUDO := $(shell [ "$$(id -u)" = 0 ] || echo sudo)

export OMPI_ALLOW_RUN_AS_ROOT := 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM := 1
# The numerics are many small operations: threads would only take cores from the other run.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.PHONY: help sweep stream streams campaign dataset natural report test slow validate sanitize bench accuracy forces listening recognise \
        stability mutants pictures engine setup lint docs clean

help:  ## this list
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

sweep: setup  ## every mixing ratio of SCENE into OUT, then OUT/report.html; OVERWRITE=1 replaces runs of another scene
	$(PYTHON) -m dem sweep '$(SCENE)' --out '$(OUT)' --jobs $(JOBS) $(if $(OVERWRITE),--overwrite)
	$(PYTHON) -m report '$(OUT)'

dataset: setup  ## hundreds of runs into runs/dataset, and every method of recognition on runs it was not trained on
	$(PYTHON) -m dem dataset scenes/dataset.toml --out runs/dataset --jobs $(JOBS)
	$(PYTHON) -m recognition evaluate runs/dataset

natural: setup  ## draws of stones that vary into runs/natural, and the report of runs/paper with them
	$(PYTHON) -m dem dataset scenes/dataset_natural.toml --out runs/natural --jobs $(JOBS)
	$(PYTHON) -m report runs/paper

campaign: setup .venv/campaign  ## every run of scenes/campaign.toml into runs/campaign, by Snakemake
	$(PYTHON) -m dem campaign scenes/campaign.toml --out runs/campaign --jobs $(JOBS)

stream: setup  ## scenes/stream.toml, a hundred stones on a tilted plate, and its report in runs/stream
	$(PYTHON) -m dem run scenes/stream.toml --out runs/stream/ratio_030
	$(PYTHON) -m report runs/stream

streams: setup  ## eighty-four streams of known truth for recognition into runs/streams
	$(PYTHON) -m dem dataset scenes/streams.toml --out runs/streams --jobs $(JOBS)

report: setup  ## the report again from the runs in OUT
	$(PYTHON) -m report '$(OUT)'

# A file of tests stays in one process, so that what its tests share is made once. Programs that they start compile once.
TESTS = $(PYTHON) -m pytest -q --numprocesses $(JOBS) --dist loadfile --durations 10 -m
test slow: export PYTHONDONTWRITEBYTECODE :=
test: setup .venv/test .venv/campaign  ## the tests but those of half a second or more
	$(TESTS) 'not slow and not validate'

slow: setup .venv/test .venv/campaign .venv/browser build/chromium  ## the tests of half a second or more; CI runs both
	$(TESTS) 'slow and not validate'

validate: setup .venv/test .venv/campaign .venv/browser build/chromium build/slurm build/calculix build/paraview  ## the long checks
	$(PYTHON) -m pytest -q -m validate

# Each report ends the engine. What Open MPI and the library keep to the end is no leak of ours to mend.
sanitize: export ASAN_OPTIONS := detect_leaks=0:detect_stack_use_after_return=1:strict_init_order=1
sanitize: export UBSAN_OPTIONS := halt_on_error=1:print_stacktrace=1
sanitize: setup .venv/test  ## the engine with address and undefined-behaviour sanitizers over one scene of each kind
	$(MAKE) -C dem/engine BUILD=$(abspath build/sanitize) \
	  CHECKS='-O1 -g -fno-omit-frame-pointer -fsanitize=address,undefined -D_GLIBCXX_ASSERTIONS'
	LIGGGHTS_BONDED=$(abspath build/sanitize/liggghts-bonded) $(PYTHON) -m pytest -q --durations 0 tests/robustness/sanitized.py

bench: setup  ## cost and results of the bonds beside other codes, into runs/bench
	$(PYTHON) -m lab run codes --out runs/bench

accuracy: setup  ## error against run time, and what each part of a scene costs, into runs/accuracy
	$(PYTHON) -m lab run work_precision tolerance omissions free_flight --out runs/accuracy

# Simulated sensors have no noise, and `listen` refuses a record without: 20 dB below the signal, always the same.
define NOISY
import sys, numpy, pandas
from recognition.estimation.noise import with_noise
with_noise(pandas.read_parquet(sys.argv[1]), 20.0, numpy.random.default_rng(1)).to_parquet(sys.argv[2])
endef
export NOISY

# Where a stone falls alone, as x,y in m, to tell the plate's modes.
TAPS := 0.11,0.07 -0.16,0.02 0.03,-0.17 -0.08,0.19

recognise: setup  ## a stream is simulated, its plate tapped, its stones heard one by one: the ratio over time in runs/recognise
	$(PYTHON) -m dem run scenes/listening.toml --out runs/recognise/ratio_040
	@: > runs/recognise/taps.toml
	for at in $(TAPS); do x=$${at%,*} y=$${at#*,}; \
	  $(PYTHON) -m dem run scenes/tap.toml --set "stones.positions_m=[[$$x,$$y]]" --out runs/recognise/tap_$$at || exit 1; \
	  printf '[[taps]]\nrecord = "tap_%s/fast.parquet"\nunknown_force = true\nplace_m = [%s, %s]\n' $$at $$x $$y >> runs/recognise/taps.toml; done
	$(PYTHON) -m recognition tap scenes/listening.toml runs/recognise/taps.toml --out runs/recognise/plate.json --max-frequency 10000
	$(PYTHON) -c "$$NOISY" runs/recognise/ratio_040/fast.parquet runs/recognise/record.parquet
	$(PYTHON) -m recognition listen runs/recognise/record.parquet --plate runs/recognise/plate.json --radius 0.025 0.025 --speed 2 4 \
	  --out runs/recognise/heard
	$(PYTHON) -m report runs/recognise

forces: setup  ## what `listen` knows of stones, learnt anew from simulated ones; after any change of the rock
	$(PYTHON) -m lab run stone_forces --out runs/stone_forces

listening: setup  ## streams of known truth, and what is heard of them, into runs/listening
	$(PYTHON) -m lab run listening listening_noise --out runs/listening

stability: setup  ## extreme scenes, each finished or refused by name, into runs/stability
	$(PYTHON) -m lab run stability --out runs/stability --jobs $(JOBS)

mutants: setup .venv/test  ## do the tests see each mutation of the physics? hours; build/mutants/mutants.csv
	$(PYTHON) -m lab.mutants --jobs $(JOBS)

pictures: setup .venv/browser build/chromium build/paraview  ## the pictures of the README and of docs/gallery.md from the runs in OUT
	$(PYTHON) -m lab.pictures.gallery $(OUT)
	$(PYTHON) -m lab.pictures.film $(OUT)
	xvfb-run -a pvpython $(OUT)/ratio_050/view.py $(abspath docs/pictures/view.png) 0.012

lint: setup .venv/lint  ## style and types of the Python code
	$(PYTHON) -m ruff check .
	$(PYTHON) -m mypy

docs: setup .venv/docs  ## pages of the programming interface into build/docs; a warning is an error
	$(PYTHON) -W error -m pdoc common dem plate_fem analysis recognition report gangue $(MODULES) -o build/docs

# Packages of Python are fetched while those of Debian are unpacked, after which the engine compiles.
setup:
	@$(MAKE) --no-print-directory --jobs=$(JOBS) engine .venv/installed

engine: build/engine/liggghts-bonded  ## the engine: LIGGGHTS with bonds and the moving plate

build/engine/liggghts-bonded: build/packages $(wildcard dem/engine/* dem/engine/*/*)
	$(MAKE) -C dem/engine BUILD=$(abspath build/engine)

build/python:
	mkdir -p build
	@python3 -c 'import ensurepip' 2>/dev/null || { $(SUDO) apt-get update && \
	  $(SUDO) apt-get install -y --no-install-recommends python3-venv; }
	touch $@

build/packages: | build/python
	@if dpkg-query -W libliggghts-dev >/dev/null 2>&1 \
	  && command -v mpicxx >/dev/null && command -v liggghts >/dev/null && [ -f /usr/include/zlib.h ]; then \
	  echo "Debian packages: there"; else \
	  $(SUDO) apt-get update && $(SUDO) apt-get install -y --no-install-recommends $(PACKAGES); fi
	touch $@

build/slurm: build/packages
	$(SUDO) apt-get install -y --no-install-recommends slurm-wlm munge
	touch $@

# The solid models that the plate is compared with, in `make validate` alone.
build/calculix: | build/packages
	@command -v ccx >/dev/null || { $(SUDO) apt-get update && \
	  $(SUDO) apt-get install -y --no-install-recommends calculix-ccx; }
	touch $@

# ParaView, and a screen for it that is none: view.py is run in it, in `make validate` alone.
build/paraview: | build/packages
	@command -v pvpython >/dev/null && command -v xvfb-run >/dev/null || { $(SUDO) apt-get update && \
	  $(SUDO) apt-get install -y --no-install-recommends paraview python3-paraview xvfb xauth libgl1-mesa-dri; }
	touch $@

# The browser in which the page of the report is tested.
build/chromium: | build/packages
	@command -v chromium >/dev/null || { $(SUDO) apt-get update && \
	  $(SUDO) apt-get install -y --no-install-recommends chromium; }
	touch $@

.venv/installed: pyproject.toml | build/python
	[ -x $(PYTHON) ] || python3 -m venv .venv
	$(INSTALL) -e '.[report]'
	touch $@

# What only some targets need is an extra of pyproject.toml, installed when first asked for.
.venv/%: pyproject.toml .venv/installed
	$(INSTALL) -e '.[$*]'
	touch $@

clean:  ## removes what was built, not what was run
	rm -rf build .venv
