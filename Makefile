# `make serve` and `make test` do all their own set-up. They need Python 3.11 or newer and make, and
# node for some of the tests.
PYTHON ?= python3
SERVE  := .venv-serve
RELEASE := .venv-release
DEV    := .venv
BLENDER := .venv-blender
CLIENTS := .venv-clients
PEERS := .venv-bench
INTEROP := .venv-interop
# Tests start hundreds of processes: each would compile the sources anew.
unexport PYTHONDONTWRITEBYTECODE
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PIP_ROOT_USER_ACTION := ignore
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PIP_ROOT_USER_ACTION := ignore
# Pins what is installed, and what builds it. pip takes a list here: a blank in the folder's name would part it.
export PIP_CONSTRAINT := file://$(subst $() ,%20,$(CURDIR))/constraints.txt
# What has one maintainer is pinned by hash, and first.
HASHED := --quiet --no-deps --require-hashes --requirement requirements/meshopt.txt

# The loops, and the module that they are compiled into.
LOOPS := $(wildcard pns_common/kernels/*.py pns_common/kernels/*.c)
COMPILED := pns_common/kernels/compiled.abi3.so

# A file's tests run in one process: what they share, a service say, is started once. Files come in
# the order of tests/conftest.py.
PROCESSES ?= 2
PYTEST := OMP_NUM_THREADS=1 $(DEV)/bin/python -m pytest -n $(PROCESSES) --dist loadfile --no-loadscope-reorder

.PHONY: prose size bench hashes soak manifest serve test checks lint kernels shapes unit quick exhaustive verify-models docs fuzz models constraints clean blender addon blender-test blender-measure blender-pictures interop-test paper-hero web release pictures

serve: $(SERVE)/.ready
	@$(SERVE)/bin/pns serve $(if $(HOST),--host $(HOST)) $(if $(PORT),--port $(PORT))

# Tests wait now and then, for processes that start and clients that stall: the checks, of one core, take
# that time. So they are done when the tests are.
test: kernels $(CLIENTS)/.ready
	$(MAKE) --jobs 2 unit checks

checks:
	nice -n 5 $(MAKE) --output-sync=target lint shapes

# Lines and files by package, held to .ci/size.json.
size:
	$(PYTHON) .ci/size.py

lint: $(DEV)/.ready size
	$(DEV)/bin/ruff check .
	$(DEV)/bin/ruff format --check .
	$(DEV)/bin/pyright
	$(DEV)/bin/lint-imports
	$(DEV)/bin/python docs/prose.py

# Fails for docstrings that open with no verb, and for sentences of more than 40 words.
prose: $(DEV)/.ready
	$(DEV)/bin/python docs/prose.py

# Half a minute, again after each change of a loop.
kernels: $(COMPILED)

$(COMPILED): $(LOOPS) | $(DEV)/.ready
	$(DEV)/bin/python setup.py --quiet build_ext --inplace

# Of each test of pns_common the first parameters, with the shapes of arrays checked.
shapes: kernels
	OMP_NUM_THREADS=1 $(DEV)/bin/python -m pytest tests/library

unit: kernels $(CLIENTS)/.ready
	$(PYTEST) tests

# What neither trains, nor starts programs, nor reads the whole collection of assets.
quick: kernels
	$(PYTEST) -m 'not (spawning or training or conformance or retrain or exhaustive)' tests

# Meshes of other libraries with the real ones, Open3D too, which is too large for the tests' environment: none is
# skipped. What they bring for pytest is left alone.
interop-test: $(INTEROP)/.ready
	$(INTEROP)/bin/python -c 'import meshio, open3d, pyvista, trimesh'
	PYTEST_DISABLE_PLUGIN_AUTOLOAD=1 OMP_NUM_THREADS=1 $(INTEROP)/bin/python -m pytest tests/library/interop

# What `make test` shows on one of each kind, on all there are.
exhaustive: kernels
	$(PYTEST) -m exhaustive tests

# The recipes of the quick models give the bundled files again, byte for byte on the machine they were
# made on; else of the same quality. And the numbers on cards that take longest to measure.
verify-models: $(DEV)/.ready
	$(PYTEST) -m retrain tests/export

# The site, from docs/ to build/docs: no network, and a warning is an error.
docs: $(DEV)/.ready
	$(DEV)/bin/python -m sphinx -W --keep-going -q -b html docs build/docs

# Malformed files by the thousand: FUZZ='--count 1000', or --seconds 60, for less.
FUZZ ?= --count 100000
fuzz: $(DEV)/.ready
	$(DEV)/bin/python -m tests.fuzz $(FUZZ)

# Train and export the bundled models again; the same machine gives the same bytes. MODELS=paper
# takes half a minute; general takes some minutes.
MODELS ?= paper signed general general-quad
models: $(DEV)/.ready
	set -e; for recipe in $(MODELS); do \
	  $(DEV)/bin/python train/run.py train --recipe $$recipe; \
	  $(DEV)/bin/python export/run.py --checkpoint build/checkpoints/$$recipe.safetensors --install; \
	done

# Honest and hostile clients at one service: SOAK='--minutes 1440' for a day.
SOAK ?= --minutes 10
soak: kernels
	$(DEV)/bin/python -m tests.soak $(SOAK)

# What the image installs, by hash: after a change of constraints.txt. It needs pip-tools.
PIP_COMPILE := pip-compile --quiet --generate-hashes --strip-extras --allow-unsafe --no-header --no-annotate --no-emit-index-url --no-emit-trusted-host --no-emit-find-links --constraint constraints.txt
hashes:
	$(PIP_COMPILE) --extra service --extra tracing --unsafe-package meshopt --output-file requirements/service.new pyproject.toml
	$(PYTHON) requirements/without_ourselves.py requirements/service.new requirements/service.txt
	$(PIP_COMPILE) --output-file requirements/build.txt requirements/build.in

# After a bundled model was put in its place by hand.
manifest: $(DEV)/.ready
	$(DEV)/bin/python -c "from pathlib import Path; from pns_common.model.file import write_manifest; write_manifest(Path('pns_common/models'))"

# Blender as a module, a version each in an environment of its own: 350 MB, and each for one version of
# Python. A missing Python leaves its version out.
BPY := addons/blender/requirements
$(BLENDER)-4.5/.ready: PYTHON := python3.11
$(BLENDER)-5.0/.ready: PYTHON := python3.11
$(BLENDER)-5.2/.ready: PYTHON := python3.13
$(BLENDER)-%/.ready: $(BPY)-%.txt
	$(PYTHON) -m venv $(BLENDER)-$*
	PIP_CONSTRAINT= $(BLENDER)-$*/bin/python -m pip install --quiet --requirement $(BPY)-$*.txt
	touch $@

# It imports, animates and renders a skinned and a morphed result: docs/blender-*.png.
blender: $(DEV)/.ready $(BLENDER)-5.0/.ready
	$(DEV)/bin/python -m tests.blender.run $(BLENDER)-5.0/bin/python

# Sheets of control mesh, Loop, an untrained control and PNS: docs/blender-*.png. Blender's Python gets what
# the library needs from a folder, as its environment is to stay as Blender has it.
blender-pictures: paper-hero $(DEV)/.ready $(BLENDER)-5.0/.ready build/blender-site/.ready
	$(DEV)/bin/pns example build/part.glb
	$(DEV)/bin/python -m addons.blender.gallery $(BLENDER)-5.0/bin/python build/part.glb

# The paper's first figure, rendered: docs/blender-paper.png. Its two networks are trained where they are not
# kept from an earlier run.
paper-hero: $(DEV)/.ready $(BLENDER)-5.0/.ready build/blender-site/.ready
	$(DEV)/bin/python -m train.experiments.paper.hero_panels build/paper-hero
	PYTHONPATH=build/blender-site $(BLENDER)-5.0/bin/python addons/blender/panels.py build/paper-hero \
	  -o docs/blender-paper.png --field distance --highest 0.1 --label 'Distance from the ridge' > /dev/null

build/blender-site/.ready: $(DEV)/.ready constraints.txt
	$(DEV)/bin/python -m pip install --quiet --no-deps --upgrade --target build/blender-site jaxtyping wadler-lindig onnxruntime
	touch $@

# The Blender extension, packed and validated by Blender's own tool: dist/pns_refine-VERSION-PLATFORM-pythonX.Y.zip.
# BPY_PLATFORM names another than this machine's (linux-x64, windows-x64 or macos-arm64), and LIBRARY its wheel.
addon: addon-5.0

addon-%: $(RELEASE)/.ready $(BLENDER)-%/.ready
	$(RELEASE)/bin/python -m addons.blender.build $(BLENDER)-$*/bin/python $(BPY_PLATFORM) $(LIBRARY)

# The newest zip for a version's Python.
ZIP_FOR = $$(ls -t "$(CURDIR)"/dist/pns_refine-*-$$(basename "$$(readlink -f $(BLENDER)-$(1)/bin/python)").zip | head -1)

# The time of the extension for 100,000 vertices, beside the library alone.
blender-measure: addon-5.0
	$(BLENDER)-5.0/bin/python addons/blender/measure.py "$(call ZIP_FOR,5.0)"

# It is installed from the zip into each of these, and every property that it keeps is looked at.
BPY_VERSIONS ?= 4.5 5.0 $(if $(shell python3.13 --version 2>/dev/null),5.2)
blender-test: $(BPY_VERSIONS:%=blender-test-%)

blender-test-%: addon-%
	zip="$(call ZIP_FOR,$*)"; cd tests/addons/blender/in_blender; \
	PNS_ADDON="$$zip" OMP_NUM_THREADS=1 "$(CURDIR)"/$(BLENDER)-$*/bin/python -m pytest -c pytest.ini --confcutdir .

# The page: from web/ to the bundle in service/web, which is committed. Only who changes it needs node.
web: web/node_modules/.ready
	cd web && node node_modules/typescript/bin/tsc --noEmit && node build.mjs

# The page in Chromium against a real server; without chromium its tests are skipped, by name.
web-test: $(DEV)/.ready web/node_modules/.ready
	cd web && PNS="$(CURDIR)"/$(DEV)/bin/pns node --test --test-concurrency=2 test/*.test.mjs

# README's sheet, the page's example and the guides' pictures, of shapes made by code; then `make web`.
pictures: kernels
	$(DEV)/bin/python docs/picture.py
	$(DEV)/bin/python docs/few_faces.py

# The pictures of the page, and how fast the page is on this machine.
web-pictures web-measure: web-%: $(DEV)/.ready web/node_modules/.ready
	cd web && PNS="$(CURDIR)"/$(DEV)/bin/pns node $*.mjs

web/node_modules/.ready: web/package-lock.json
	cd web && npm ci --ignore-scripts --no-audit --no-fund
	touch $@

# Inference only: no torch. Without a C compiler say JIT=1, and numba compiles at the first request.
comma := ,
$(SERVE)/.ready: pyproject.toml setup.py constraints.txt $(LOOPS)
	@echo "Installing into $(SERVE), once: some 260 MB, a minute or two; the loops are compiled meanwhile"
	$(PYTHON) -m venv $(SERVE)
	$(SERVE)/bin/python -m pip install $(HASHED)
	$(SERVE)/bin/python -m pip install --quiet --editable '.[service$(if $(JIT),$(comma)jit)]'
	touch $@

# The generator of Python clients, for their test.
$(CLIENTS)/.ready: requirements/clients.txt
	$(PYTHON) -m venv $(CLIENTS)
	PIP_CONSTRAINT= $(CLIENTS)/bin/python -m pip install --quiet --requirement requirements/clients.txt
	touch $@

$(INTEROP)/.ready: pyproject.toml setup.py constraints.txt requirements/interop.txt
	$(PYTHON) -m venv $(INTEROP)
	$(INTEROP)/bin/python -m pip install --quiet --editable . --requirement requirements/interop.txt
	touch $@

$(DEV)/.ready: pyproject.toml setup.py constraints.txt
	@echo "Installing into $(DEV), once: some gigabytes with torch, some minutes"
	$(PYTHON) -m venv $(DEV)
	$(DEV)/bin/python -m pip install $(HASHED)
	$(DEV)/bin/python -m pip install --quiet torch==2.13.0
	$(DEV)/bin/python -m pip install --quiet --editable '.[dev]'
	# The laboratory is no part of the package: its commands import it from here.
	echo "$(CURDIR)" > "$$($(DEV)/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/pns-checkout.pth"
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

# Refinement beside other libraries' Loop: numbers into benchmarks/results.json. The C++ peers are built
# where Debian's packages can be had; a peer that cannot be set up is left out by name.
# Ours runs in the environment of `make serve`, as users have it; BENCH holds further options.
bench: $(DEV)/.ready $(SERVE)/.ready $(PEERS)/.ready build/bench/.ready
	$(DEV)/bin/python -m benchmarks --python $(SERVE)/bin/python $(BENCH)

# One by one: a library without a build for this machine keeps no other away.
$(PEERS)/.ready: benchmarks/peers/requirements.txt
	$(PYTHON) -m venv $(PEERS)
	grep -v '^#' $< | while read peer; do \
	  PIP_CONSTRAINT= $(PEERS)/bin/python -m pip install --quiet $$peer || echo "left out: $$peer"; \
	done
	touch $@

DRIVER := $(CXX) -std=c++17 -O3 -march=native -DNDEBUG
build/bench/.ready: $(wildcard benchmarks/peers/*.cpp benchmarks/peers/*.hpp)
	mkdir -p $(@D)
	-command -v apt-get > /dev/null && test "$$(id -u)" = 0 && \
	  apt-get install -qq --yes libosd-dev libcgal-dev libopenmesh-dev
	-$(DRIVER) benchmarks/peers/opensubdiv.cpp -o $(@D)/opensubdiv -losdCPU
	-$(DRIVER) benchmarks/peers/cgal.cpp -o $(@D)/cgal
	-$(DRIVER) benchmarks/peers/openmesh.cpp -o $(@D)/openmesh -lOpenMeshTools -lOpenMeshCore
	touch $@

# All that users install, in dist/release: wheel, source, pinned requirements, Blender's zips, the image where there
# is a docker, a bill of materials and the sums. A fresh environment is installed from these files, and refines.
release: $(RELEASE)/.ready
	$(RELEASE)/bin/python deploy/release.py

$(RELEASE)/.ready: requirements/build.in
	$(PYTHON) -m venv $(RELEASE)
	$(RELEASE)/bin/python -m pip install --quiet build jaxtyping numpy --requirement requirements/build.in
	touch $@

clean:
	rm -rf $(SERVE) $(DEV) $(RELEASE) $(CLIENTS) $(PEERS) $(INTEROP) $(BLENDER)-* build dist *.egg-info .pytest_cache .ruff_cache .hypothesis tests/node/node_modules web/node_modules results/cache
