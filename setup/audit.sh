#!/usr/bin/env bash
# Looks the pinned libraries up in the database of the Python packaging authority. Called by
# `make audit`. Exit code 1: there are vulnerabilities; 2: the database could not be asked.
set -euo pipefail
source "$(dirname -- "${BASH_SOURCE[0]}")/project.sh"

auditor=pip-audit==2.10.1
answer=$(mktemp)
trap 'rm -f "$answer"' EXIT

for pins in core dev; do
    say "requirements/$pins.txt"
    status=0
    "$venv/bin/uv" tool run --quiet "$auditor" --disable-pip --require-hashes --progress-spinner off \
        --requirement "$root/requirements/$pins.txt" >"$answer" 2>&1 || status=$?
    if grep -qE 'could not be audited|Connection|Max retries|ServiceError|dns error' "$answer"; then
        tail -n 3 "$answer" >&2
        say 'The database of vulnerabilities at pypi.org cannot be asked from here, or not for all:' \
            'run `make audit` where it can.' >&2
        exit 2
    fi
    cat "$answer"
    ((status == 0)) || exit 1
done
