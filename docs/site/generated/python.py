"""The public names, for mkdocstrings to fill in."""

import paint_deposition


def text() -> str:
    """An entry for each; it is looked up where it is defined."""
    names = [name for name in dir(paint_deposition) if not name.startswith('_')]
    objects = [getattr(paint_deposition, name) for name in names]
    return '\n'.join(
        f'::: {thing.__module__}.{thing.__qualname__}\n'
        for thing in sorted(objects, key=lambda thing: (isinstance(thing, type), thing.__name__))
    )
