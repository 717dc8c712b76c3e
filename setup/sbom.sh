#!/usr/bin/env bash
# Writes runs/sbom.json: the libraries that the package brings, with versions and hashes, as
# CycloneDX. Called by `make sbom`.
set -euo pipefail
source "$(dirname -- "${BASH_SOURCE[0]}")/project.sh"

mkdir -p "$root/runs" "$root/.setup"
logged 'Listing the libraries' \
    "$venv/bin/uv" tool run --from cyclonedx-bom==7.5.0 cyclonedx-py requirements \
    --pyproject "$root/ros2_ws/src/paint_deposition/pyproject.toml" --mc-type library \
    --output-file "$root/runs/sbom.json" "$root/requirements/core.txt"
say "runs/sbom.json"
