# `make serve` and `make test` do all their own set-up. They need Python 3.11 or newer and make, and
# node for some of the tests.
PYTHON ?= python3
SERVE  := .venv-serve
DEV    := .venv
BLENDER := .venv-blender
# Pins what is installed, and what builds it.
export PIP_CONSTRAINT := $(CURDIR)/constraints.txt
# What has one maintainer is pinned by hash, and first.
HASHED := --quiet --no-deps --require-hashes --requirement requirements/meshopt.txt

.PHONY: serve test lint unit fuzz models constraints clean blender

serve: $(SERVE)/.ready
	$(SERVE)/bin/pns serve $(if $(HOST),--host $(HOST)) $(if $(PORT),--port $(PORT))

test: lint unit

lint: $(DEV)/.ready
	$(DEV)/bin/ruff check .
	$(DEV)/bin/ruff format --check .
	$(DEV)/bin/pyright
	$(DEV)/bin/lint-imports

unit: $(DEV)/.ready
	OMP_NUM_THREADS=1 $(DEV)/bin/python -m pytest -n 2 --dist loadgroup

# Malformed files by the thousand: FUZZ='--count 1000', or --seconds 60, for less.
FUZZ ?= --count 100000
fuzz: $(DEV)/.ready
	$(DEV)/bin/python -m tests.fuzz $(FUZZ)

# Train and export the bundled models again; the same machine gives the same bytes. MODELS=ridge, the
# recipe of `paper`, takes half a minute; full takes half an hour.
MODELS ?= ridge signed full
models: $(DEV)/.ready
	set -e; for recipe in $(MODELS); do \
	  $(DEV)/bin/python train/run.py train --recipe $$recipe; \
	  $(DEV)/bin/python export/run.py --checkpoint checkpoints/$$recipe.safetensors; \
	done

# Blender imports, animates and renders a skinned and a morphed result: docs/blender-*.png. bpy is
# large, for Python 3.11 alone, and wants an older numpy: it has a venv of its own, without our pins.
blender: $(DEV)/.ready $(BLENDER)/.ready
	$(DEV)/bin/python -m tests.blender.run $(BLENDER)/bin/python

$(BLENDER)/.ready: tests/blender/requirements.txt
	$(PYTHON) -m venv $(BLENDER)
	PIP_CONSTRAINT= $(BLENDER)/bin/python -m pip install --quiet --requirement tests/blender/requirements.txt
	touch $@

# Inference only: no torch.
$(SERVE)/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(SERVE)
	$(SERVE)/bin/python -m pip install $(HASHED)
	$(SERVE)/bin/python -m pip install --quiet --editable .
	touch $@

$(DEV)/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(DEV)
	$(DEV)/bin/python -m pip install $(HASHED)
	$(DEV)/bin/python -m pip install --quiet torch==2.13.0
	$(DEV)/bin/python -m pip install --quiet --editable '.[dev]'
	touch $@

# Resolve every dependency anew within pyproject's ranges and write the pins.
constraints: export PIP_CONSTRAINT :=
constraints:
	rm -rf .venv-constraints
	$(PYTHON) -m venv .venv-constraints
	.venv-constraints/bin/python -m pip install --quiet torch==2.13.0
	.venv-constraints/bin/python -m pip install --quiet --editable '.[dev]'
	.venv-constraints/bin/python -m pip freeze --exclude-editable --all | grep -vE '^pip==' | sed 's/+[a-z0-9.]*$$//' > constraints.txt.new
	mv constraints.txt.new constraints.txt
	rm -rf .venv-constraints

clean:
	rm -rf $(SERVE) $(DEV) $(BLENDER) build dist *.egg-info .pytest_cache .ruff_cache .hypothesis tests/node/node_modules results/cache
