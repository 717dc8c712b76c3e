"""Errors that a user can act on: one line naming the thing, its value and the remedy."""


class PaintError(Exception):
    """Base of every error this package raises on purpose; its text is shown to the user as is."""


class MeshError(PaintError):
    """The part's mesh cannot be used."""


class RecordingError(PaintError):
    """A bag, topic or pose stream cannot be used."""


class ModelError(PaintError):
    """A deposition model, its file or one of its effects is not valid."""


class ReadingsError(PaintError):
    """Gauge readings or a campaign cannot be used."""


class PlanError(PaintError):
    """A request for passes or an index has no answer."""
