# make            the environment, the whole study and its report
# make smoke      the same in a few minutes, in results/smoke
# make trust      how often is each status right? trials on thousands of recordings, in results/trust
# make reality    how accurate are models of lines that no library contains? in results/reality
# make published  published comparisons of methods, repeated, in results/published
# make exam       has an edit changed what is identified? some 300 recordings beside the reference
# make paper      what the paper leaves out, inferred from its numbers, in results/paper
# make test       the study, then its checks; SLOW=yes: all checks, as in CI
# make repair     after a killed run, a crash or an edited result: repair, then run the study
# make verify     compare every result with its receipt, and every receipt with the settings
# make publish    the finished study as a folder and an archive, in results/publication
# make verify ARCHIVE=file    check such an archive, and compare its numbers with this study's
# make restore ARCHIVE=file   put the results of such an archive in place
# make prune      list results that the settings no longer ask for; DELETE=yes removes them
# make test-faults  small studies killed, interrupted, out of disk space: are they repaired?
# make test-slurm the small version on a SLURM cluster of this machine, a job cancelled; Debian, root
# make lint       style checks alone
# make bench      measured speed, in results/benchmarks.csv; OLDER=folder of results to compare with
# make reference  take the numbers of the study and of its small version as results/reference
# make release    a wheel and a source distribution in dist, if no check objects; DRAFT=yes: in any case
# make pages      the pages of docs/ as a site to read, in results/pages; its examples are run
# make docs       write again what pages and editors show: settings, their schema, rules, results, example pictures
# make tools      packages that only development needs: style, types, pages, clusters, selenium
# make lock       pin both environments again, and check that other systems can install them
#
# STRATUM=names   of the exam, only these strata; BEFORE=file: an answers.csv to compare with
# CONFIG=file     settings merged over config/config.yaml, or over those of smoke, trust and so on
# ALLOW=list      publish although dirty, incomplete, outdated
# SHA256=digest   of an archive, as it was published: for verify and restore
# REPLACE=yes     restore over other results, which are set aside
# DELETE=yes      prune what was listed
# CORES=n         how many cores to use; all
# PROFILE=slurm   run the jobs on a cluster: config/README.md, "On a cluster"
PYTHON ?= python3
CORES ?= all
VENV := .venv
BIN := $(VENV)/bin
# The environment of the study and its checks, and that with what development needs besides.
MADE := $(VENV)/made
TOOLS := $(VENV)/tools
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --use-pep517 --require-hashes
SCRIPT := PYTHONPATH=workflow/src $(BIN)/python workflow/scripts
OPTIONS := $(if $(CONFIG),--configfile $(CONFIG))
WHERE := $(if $(PROFILE),--workflow-profile workflow/profiles/$(PROFILE),--cores '$(CORES)')
DIGEST := $(if $(SHA256),--sha256 '$(SHA256)')
ALL_TESTS := $(CI)$(filter yes,$(SLOW))

.PHONY: all study smoke trust reality published exam paper test browser repair verify publish restore prune test-faults test-slurm lint bench reference docs pages release tools lock help
all: study

study: $(if $(PROFILE),$(TOOLS),$(MADE))
	@$(SCRIPT)/run_study.py $(WHERE) $(OPTIONS)

smoke trust reality published paper:
	@$(MAKE) --no-print-directory study CONFIG='config/$@.yaml $(CONFIG)'

exam: $(if $(PROFILE),$(TOOLS),$(MADE))
	@$(SCRIPT)/take_exam.py $(WHERE) --configfile config/exam.yaml $(CONFIG) $(if $(STRATUM),--stratum $(STRATUM)) $(if $(BEFORE),--before '$(BEFORE)')

repair: $(if $(PROFILE),$(TOOLS),$(MADE))
	@$(SCRIPT)/run_study.py --repair $(WHERE) $(OPTIONS)

verify: $(MADE)
	@$(SCRIPT)/keep_results.py $(if $(ARCHIVE),verify_archive '$(ARCHIVE)' $(DIGEST),verify) $(OPTIONS)

publish: $(MADE)
	@$(SCRIPT)/keep_results.py publish --allow '$(ALLOW)' $(OPTIONS)

restore: $(MADE)
	@[ -n '$(ARCHIVE)' ] || { echo "Say what to restore: make restore ARCHIVE=file"; exit 1; }
	@$(SCRIPT)/keep_results.py restore '$(ARCHIVE)' $(if $(filter yes,$(REPLACE)),--replace) $(DIGEST) $(OPTIONS)

prune: $(MADE)
	@$(SCRIPT)/keep_results.py prune $(if $(filter yes,$(DELETE)),--delete) $(OPTIONS)

test: study $(if $(ALL_TESTS),$(TOOLS) browser)
	$(BIN)/python -m pytest -n 2 --dist loadgroup $(if $(ALL_TESTS),-m 'not faults and not slurm')

# For the checks of the report: Debian's Chromium, where no browser is and one may be installed.
browser:
	@command -v chromedriver >/dev/null || command -v geckodriver >/dev/null || \
	  { [ "$$(id -u)" = 0 ] && command -v apt-get && apt-get update && \
	    apt-get install -y --no-install-recommends chromium chromium-driver; } >/dev/null 2>&1 || true

test-faults: $(MADE)
	$(BIN)/python -m pytest -m '' tests/faults

test-slurm: $(TOOLS)
	timeout --foreground --signal INT --kill-after 60 40m $(BIN)/python -m pytest -m slurm tests/cluster

lint: $(TOOLS)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/snakefmt --check Snakefile workflow/Snakefile workflow/rules
	$(BIN)/snakemake --lint

bench: study
	PYTHONPATH=workflow/src OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 \
	  $(BIN)/python workflow/scripts/bench.py results results/benchmarks.csv $(OLDER)

reference: study
	@$(SCRIPT)/keep_results.py take_reference $(OPTIONS)
ifndef CONFIG
	cp $(addprefix results/figures/,galloping.gif printed.png overview.png) results/reference
	@$(MAKE) --no-print-directory reference CONFIG=config/smoke.yaml
endif
	@$(MAKE) --no-print-directory study

docs: $(MADE)
	PYTHONPATH=workflow/src $(BIN)/python -m galloping.configuration.schema config/README.md \
	  workflow/schemas/config.schema.json
	@$(SCRIPT)/draw_rules.py docs/rules.svg
	PYTHONPATH=workflow/src $(BIN)/python docs/from_results.py docs/*.md
	PYTHONPATH='$(CURDIR)/workflow/src' $(BIN)/python docs/draw_examples.py examples

release: $(TOOLS)
	@$(SCRIPT)/release.py dist $(if $(filter yes,$(DRAFT)),--draft)

pages: $(TOOLS)
	@PYTHONPATH='$(CURDIR)/workflow/src' $(BIN)/python -m sphinx -q -W --keep-going docs results/pages
	@echo 'The pages begin with results/pages/index.html'

tools: $(TOOLS)

# The environment, byte-compiled once; only when the lock changes. With the command `galloping`, and
# what numba compiles kept beside the library.
$(MADE): requirements.lock
	@[ ! -L $(VENV) ] || { echo "$(VENV) is a link, and the environment would be made in the" \
	  "folder that it points to: remove the link, and run again"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "Python 3.11 or newer is needed: make PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv --clear $(VENV)
	$(PIP) -r requirements.lock
	@cp workflow/scripts/galloping.sh $(BIN)/galloping
	@chmod +x $(BIN)/galloping
	@$(SCRIPT)/compile_library.py
	@touch $@

$(TOOLS): $(MADE) requirements-dev.lock
	$(PIP) -r requirements-dev.lock
	@touch $@

lock: $(TOOLS)
	$(BIN)/uv pip compile pyproject.toml --extra dev --universal --python-version 3.11 \
	  --generate-hashes --custom-compile-command "make lock" --upgrade -o requirements-dev.lock
	cp requirements-dev.lock requirements.lock
	$(BIN)/uv pip compile pyproject.toml --extra test --universal --python-version 3.11 \
	  --generate-hashes --custom-compile-command "make lock" -o requirements.lock
	$(SCRIPT)/write_environment.py
	$(SCRIPT)/check_wheels.py

help:
	@sed -n '/^# make/,/^#* PROFILE/ s/^# \{0,1\}//p' Makefile
