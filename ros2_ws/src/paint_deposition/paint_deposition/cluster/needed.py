"""The libraries of the extra `many`, and what to install where one is missing."""

from importlib.util import find_spec

from paint_deposition.errors import ManyError

LIBRARIES = ('distributed', 'pyarrow', 'ruptures')


def require_libraries(command: str) -> None:
    """Refuse to begin without the libraries of the extra.

    Raises:
        ManyError: naming those that are missing.
    """
    missing = [name for name in LIBRARIES if find_spec(name) is None]
    if missing:
        raise ManyError(
            f'{command} needs {" and ".join(missing)}, which is not installed; run: pip install '
            f'{" ".join(missing)}, or install paint_deposition[many]'
        )
