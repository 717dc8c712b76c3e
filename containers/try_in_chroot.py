#!/usr/bin/env python3
"""Follow a Dockerfile where there is no Docker: in a new root folder made by debootstrap.

    sudo containers/try_in_chroot.py containers/slim.Dockerfile /tmp/root doctor

Needs root, debootstrap and the network. Knows what `slim.Dockerfile` uses: FROM a release of
Debian, RUN, COPY, ENV, WORKDIR and ENTRYPOINT. What follows the folder goes to the entry point.
A folder that is there already is taken as the image that FROM names.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent


def instructions(dockerfile: Path) -> list[tuple[str, str]]:
    """(word, rest) of each, in order."""
    lines = [line for line in dockerfile.read_text().splitlines() if not line.startswith('#')]
    whole = '\n'.join(lines).replace('\\\n', ' ').splitlines()
    return [tuple(line.split(maxsplit=1)) for line in whole if line.strip()]


def follow(dockerfile: Path, root: Path, arguments: list[str]) -> None:
    """Build the root folder, then run the entry point in it."""
    environment = {'PATH': '/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin'}
    folder, entry = '/', []

    def run(command: list[str]) -> None:
        settings = [f'{name}={value}' for name, value in environment.items()]
        place = ['chroot', root, 'env', '--ignore-environment', f'--chdir={folder}', *settings]
        subprocess.run([*place, *command], check=True)

    for word, rest in instructions(dockerfile):
        print(f'== {word} {rest}', flush=True)
        if word == 'FROM' and not root.exists():
            release = rest.removeprefix('debian:').removesuffix('-slim')
            subprocess.run(['debootstrap', '--variant=minbase', release, root], check=True)
        elif word == 'RUN':
            run(['/bin/sh', '-c', rest])
        elif word == 'COPY':
            source, target = rest.split()
            to = root / target.lstrip('/')
            to.parent.mkdir(parents=True, exist_ok=True)
            copy = shutil.copytree if (REPOSITORY / source).is_dir() else shutil.copy
            copy(REPOSITORY / source, to)
        elif word == 'ENV':
            environment |= dict(pair.split('=', 1) for pair in rest.split())
        elif word == 'WORKDIR':
            folder = rest
            (root / rest.lstrip('/')).mkdir(parents=True, exist_ok=True)
        elif word == 'ENTRYPOINT':
            entry = json.loads(rest)
    run([*entry, *arguments])


if __name__ == '__main__':
    follow(Path(sys.argv[1]), Path(sys.argv[2]).absolute(), sys.argv[3:])
