"""Film build of rotary bell spray painting: simulation, calibration, diagnosis and planning.

`import paint_deposition as paint` costs nothing: the public names, which `__init__.pyi` lists with
the modules that define them, are loaded one by one when they are first used.
"""

import ast
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

__version__ = '0.2.0'


@cache
def _modules() -> dict[str, str]:
    """Public name -> module that defines it, as the stub says."""
    stub = ast.parse(Path(__file__).with_suffix('.pyi').read_text(encoding='utf-8'))
    imports = [line for line in stub.body if isinstance(line, ast.ImportFrom)]
    return {name.name: str(line.module) for line in imports for name in line.names}


def __getattr__(name: str) -> Any:
    # Python itself asks for names such as __path__ before anything is loaded.
    if name.startswith('_') or name not in _modules():
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(_modules()[name]), name)


def __dir__() -> list[str]:
    return ['__version__', *_modules()]


def git_version() -> str:
    """`git describe` of the sources, '' where they are installed away from their repository."""
    import subprocess

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
