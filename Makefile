# The front door of the project. `make` alone lists the targets.
SHELL := /bin/bash
.SHELLFLAGS := -eo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help build demo test test-fast bench bench-diagnosis bench-brushes bench-next bench-nature bench-loop bench-measure fuzz soak reliability cell many numbers lint docs format lock audit sbom wheel clean distclean

PACKAGE := ros2_ws/src/paint_deposition
IN_ENVIRONMENT := source setup/environment.sh;
# Files of tests side by side, on four cores at the most. What Python compiles of them is kept:
# compiling takes longer than most of them.
TESTS := env -u PYTHONDONTWRITEBYTECODE pytest --numprocesses auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder
PIN := .venv/bin/uv pip compile --quiet --universal --python-version 3.10 --fork-strategy fewest \
	--no-annotate --generate-hashes --custom-compile-command 'make lock' --upgrade

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-17s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

build:  ## set up the environment and the workspace (takes minutes the first time only)
	@setup/build.sh

demo: build  ## paint a door through the nodes, recommend an index, diagnose, paint a better door
	@$(IN_ENVIRONMENT) python demo/demo.py runs/demo

test: build  ## run all tests; ARGS='-k pattern' is passed to pytest
	@$(IN_ENVIRONMENT) $(TESTS) $(ARGS)

test-fast: build  ## run the tests of less than a second each, none of them with a node: a minute
	@$(IN_ENVIRONMENT) $(TESTS) -m 'not slow' $(ARGS)

bench: build  ## measure kernel, file to film, diagnosis and live nodes; ARGS=--quick tries it out
	@$(IN_ENVIRONMENT) PYTHONPATH=tests:$$PYTHONPATH python -m benchmarks.page bench $(ARGS)

bench-diagnosis: build  ## score the diagnosis on campaigns with hidden causes
	@$(IN_ENVIRONMENT) PYTHONPATH=tests:$$PYTHONPATH python -m benchmarks.page diagnosis $(ARGS)

bench-brushes: build  ## count false alarms and effects found on parts that two brushes painted
	@$(IN_ENVIRONMENT) PYTHONPATH=tests:$$PYTHONPATH python -m benchmarks.page brushes $(ARGS)

bench-measure: build  ## count the readings that chosen points save
	@$(IN_ENVIRONMENT) PYTHONPATH=tests:$$PYTHONPATH python -m benchmarks.page measure $(ARGS)

fuzz: build  ## feed changed files to the readers; ARGS='-k rapid' chooses
	@$(IN_ENVIRONMENT) FUZZ_INPUTS=$${FUZZ_INPUTS:-20000} FUZZ_SEED=$$RANDOM pytest tests/fuzz $(ARGS)

reliability: build  ## end the nodes at random moments, 50 times each
	@$(IN_ENVIRONMENT) PYTHONPATH=tests:$$PYTHONPATH python -m benchmarks.reliability $(ARGS)

cell: build  ## take 10,000 random steps in a cell, its recordings in runs/cell; ARGS goes to pytest
	@$(IN_ENVIRONMENT) PAINT_STEPS=$${PAINT_STEPS:-10000} pytest tests/nodes/test_random_cell.py --basetemp runs/cell --timeout 0 -o faulthandler_timeout=0 $(ARGS)

soak: build  ## run a cell for half an hour; ARGS='--minutes 10 --rate 750' for as much in less
	@$(IN_ENVIRONMENT) PYTHONPATH=tests:$$PYTHONPATH python -m benchmarks.page soak $(ARGS)

many: build  ## diagnose 40 parts of several days, a minute
	@$(IN_ENVIRONMENT) PAINT_LONG=1 pytest tests/inference/diagnosis/test_procedure.py -k each_day $(ARGS)

numbers: build  ## try 10,000 random parts, paths and models; ARGS goes to pytest
	@$(IN_ENVIRONMENT) PAINT_EXAMPLES=$${PAINT_EXAMPLES:-10000} pytest tests/film/test_random_paints.py --timeout 0 -o faulthandler_timeout=0 $(ARGS)

lint: build  ## check style, types and the order of the rooms
	@$(IN_ENVIRONMENT) ruff check . && ruff format --check . && mypy && lint-imports

bench-next: build  ## count how often the first proposed spray settles a diagnosis
	@$(IN_ENVIRONMENT) PYTHONPATH=tests:$$PYTHONPATH python -m benchmarks.page next_spray $(ARGS)

bench-nature: build  ## diagnose real sprays whose missing physics is known
	@$(IN_ENVIRONMENT) PYTHONPATH=tests:$$PYTHONPATH python -m benchmarks.nature $(ARGS)

bench-loop: build  ## count what diagnosing is worth in evenness: paint, measure, plan again, paint
	@$(IN_ENVIRONMENT) PYTHONPATH=tests:$$PYTHONPATH python -m benchmarks.page loop $(ARGS)

docs: build  ## build the site of the documentation into runs/site, links checked
	@.venv/bin/uv pip install --quiet --require-hashes --python .venv/bin/python -r requirements/docs.txt
	@$(IN_ENVIRONMENT) PYTHONPATH=docs/site:$$PYTHONPATH python -m generated.files
	@$(IN_ENVIRONMENT) NO_MKDOCS_2_WARNING=true mkdocs build --quiet
	@echo 'Built: runs/site/index.html; the search needs python -m http.server --directory runs/site'

format: build  ## put imports and layout in order
	@$(IN_ENVIRONMENT) ruff check --fix . ; ruff format .

wheel: build  ## build the wheel with compiled code in it, for this Python, into dist/
	@setup/wheel.sh

lock: build  ## pin the newest library versions that all supported Pythons can use
	$(PIN) requirements/core.in -c requirements/constraints.txt -o requirements/core.txt
	$(PIN) requirements/dev.in -c requirements/core.txt -o requirements/dev.txt
	$(PIN) requirements/docs.in -c requirements/core.txt -c requirements/dev.txt -o requirements/docs.txt
	$(PIN) requirements/ros.in -c requirements/core.txt -c requirements/dev.txt --excludes requirements/excluded.txt -o requirements/ros.txt

audit: build  ## look the pinned libraries up among the known vulnerabilities (needs the network)
	@setup/audit.sh

sbom: build  ## list the libraries that the package brings, as CycloneDX
	@setup/sbom.sh

clean:  ## remove everything that was built, keep the environment
	rm -rf ros2_ws/{build,install,log} $(PACKAGE)/{build,*.egg-info} .setup .{pytest,mypy,ruff}_cache .hypothesis
	find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +

distclean: clean  ## remove the environment too
	rm -rf .venv
