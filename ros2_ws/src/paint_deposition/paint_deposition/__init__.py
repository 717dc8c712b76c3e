"""Film build of rotary bell spray painting: simulation, calibration, diagnosis and planning.

`import paint_deposition as pd` costs nothing: the public names, which are those of
`paint_deposition.public`, are loaded when one of them is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from paint_deposition.public import *  # noqa: F403

__version__ = '0.1.0'


def __getattr__(name: str) -> Any:
    if not name.startswith('_'):
        public = import_module('paint_deposition.public')
        if name in public.__all__:
            return getattr(public, name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')


def __dir__() -> list[str]:
    return ['__version__', *import_module('paint_deposition.public').__all__]
