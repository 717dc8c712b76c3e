"""Film build of rotary bell spray painting: simulation, calibration, diagnosis and planning.

`import paint_deposition as pd` costs nothing: the public names, which are those of
`paint_deposition.public`, are loaded one by one when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from paint_deposition.public import *  # noqa: F403

__version__ = '0.1.0'


def __getattr__(name: str) -> Any:
    if not name.startswith('_'):
        public = import_module('paint_deposition.public')
        if name in public.DEFINED_IN:
            return getattr(import_module(f'{__name__}.{public.DEFINED_IN[name]}'), name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')


def __dir__() -> list[str]:
    return ['__version__', *import_module('paint_deposition.public').DEFINED_IN]
