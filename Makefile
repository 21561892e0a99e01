# Everything into .venv, from nothing but Python, Git and Make.
PYTHON ?= python3
CORES ?= 2
DOCKER ?= podman
VENV := .venv
BIN := $(VENV)/bin
EXTRAS := dev,docs,export,slurm,tensorboard,video
SMOKE := --configfile config/smoke.yaml
# the tools find each other, and every job finds `mtcsirl`, without an activated environment
export PATH := $(CURDIR)/$(BIN):$(PATH)

.PHONY: help setup replicate smoke quick test coverage lint bench bench-node docs image audit constraints

help:  ## print this list
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

setup: $(VENV)/.ready  ## the virtual environment with the exact versions of constraints.txt

$(VENV)/.ready: pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv $(VENV) || { echo "no venv: install Debian's python3-venv"; exit 1; }
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable ".[$(EXTRAS)]"
	touch $@

replicate: setup  ## the whole paper at desk scale: every table, figure, verdict and the report
	mtcsirl doctor --cores $(CORES)
	snakemake --cores $(CORES)

smoke: setup  ## the same in minutes, too small to mean anything
	mtcsirl doctor --cores $(CORES) --scale smoke
	snakemake --cores $(CORES) $(SMOKE)

# `reference` builds a mirror of the checkout below REFERENCE, so that links between pages stay the same
ARCHIVE := results/reference
REFERENCE := build/reference
STUDY :=
# the runs that the archive must hold, as the README says
RUNS = $(shell sed -n 's/.*[^0-9,]\([0-9,]*\) of its [0-9,]* runs.*/\1/p' README.md | head -1 | tr -d ,)
COMMITTED = git ls-files results/reference paper_figs docs/results.md | grep -v -e '/part-' -e 'README.md$$'
WITHIN = $(STUDY) --set results=$(REFERENCE)/results/reference --set figures=$(REFERENCE)/paper_figs
SHOWN := claims $(addprefix figure-,2 3 4 5 6 7 s1 s2 1 8 9) $(addprefix table-,1 2 3 4 5)

.PHONY: reference
reference: setup  ## from the committed archive, without training: every table, figure, verdict and page, as committed
	@{ $(COMMITTED); } > /dev/null 2>&1 \
	    || { echo "make reference: git names nothing committed to compare with; clone the repository with git" >&2; exit 1; }
	@gone=$$(git ls-files --deleted results/reference paper_figs docs/results.md) && [ -z "$$gone" ] \
	    || { echo "make reference: lost:" $$gone "(git checkout brings it back)" >&2; exit 1; }
	rm -rf $(REFERENCE)
	printf '%s\n' 'verify --runs $(RUNS)' 'unpack $(WITHIN)' \
	    | xargs -P $(CORES) -I '{}' sh -c 'mtcsirl archive {} --archive $(ARCHIVE)'
	{ echo "results --output $(REFERENCE)/docs"; printf '%s\n' $(SHOWN) | tr - ' '; } \
	    | xargs -P $(CORES) -I '{}' sh -c 'mtcsirl {} --partial $(WITHIN) > /dev/null'
	mtcsirl report --partial $(WITHIN)
	$(COMMITTED) | while read -r file; do cmp "$$file" "$(REFERENCE)/$$file" || exit 1; done

quick: setup  ## what one runs before each commit, under two minutes on two idle cores: lint, fast tests
	ruff check
	ruff format --check
	pytest -n $(CORES) --dist loadfile -m "not slow and not dag" --ignore tests/dag

test: setup  ## all tests; one process more than cores, as the Slurm tests mostly wait; the smoke DAG takes the cores itself
	pytest -n $$(($(CORES) + 1)) --dist loadfile --no-loadscope-reorder -m "not dag"
	pytest -n $(CORES) --dist loadgroup -m dag

coverage: setup  ## what the tests reach, but for those that run the smoke DAG; measuring it takes time
	pytest -n $(CORES) --dist loadfile --no-loadscope-reorder -m "not dag" --cov

lint: setup  ## formatting, lint and types, all of which must be clean
	ruff check
	ruff format --check
	mypy src
	snakefmt --check Snakefile workflow

# mkdocs-material says at length that the next major version of MkDocs is another program; the version here is pinned
docs: setup  ## the pages of docs/ as a searchable site, build/site/index.html; a broken link ends it
	NO_MKDOCS_2_WARNING=1 python -m mkdocs build

bench: setup  ## measured ratios against stable-baselines3, sbx, stock Meta-World and imitation
	sh benchmarks/peer_environment.sh imitation
	sh benchmarks/peer_environment.sh sbx
	python -m benchmarks

bench-node: setup  ## what this machine trains a second, on its GPU if it has one: eight minutes
	python -m benchmarks.node --workers $(CORES)

image:  ## a container with the suite and its environment, by podman or DOCKER=docker
	$(DOCKER) build --tag mtcsirl --file containers/Containerfile .

audit:  ## look constraints.txt up in a database of known vulnerabilities; needs the network
	$(PYTHON) -m venv build/audit
	build/audit/bin/python -m pip install --quiet pip-audit
	$(PYTHON) .ci/audit.py build/audit/bin/pip-audit constraints.txt

# `make constraints KEEP="--constraint constraints.txt"` adds what pyproject.toml newly asks for and changes nothing else
constraints:  ## renew requirements.lock and constraints.txt: the newest versions that pyproject.toml allows
	rm -rf build/constraints
	$(PYTHON) -m venv build/constraints
	build/constraints/bin/python -m pip install --quiet uv
	build/constraints/bin/uv pip compile pyproject.toml --quiet --all-extras --universal --fork-strategy fewest \
	    --generate-hashes --no-header --no-annotate $(KEEP) --output-file build/constraints/requirements.lock
	$(PYTHON) .ci/locks.py build/constraints/requirements.lock > build/constraints/constraints.txt
	mv build/constraints/requirements.lock build/constraints/constraints.txt .
	rm -rf build/constraints
