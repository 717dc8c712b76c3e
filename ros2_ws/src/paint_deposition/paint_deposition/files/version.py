"""Which state of the repository a package is, without loading anything."""

import subprocess
from pathlib import Path


def git_version() -> str:
    """`git describe` of the sources, '' where they are installed away from their repository."""
    command = ['git', 'describe', '--always', '--dirty', '--tags']
    folder = Path(__file__).resolve().parent
    if 'site-packages' in folder.parts:  # what repository there is, it is another project's
        return ''
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=10, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return ''
    return done.stdout.strip()
