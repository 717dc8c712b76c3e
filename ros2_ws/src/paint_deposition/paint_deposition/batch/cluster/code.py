"""The code that results are made with: results of other code are not taken for finished ones."""

import hashlib
from functools import cache
from pathlib import Path

import paint_deposition


@cache
def code_digest() -> str:
    """32 hexadecimal digits of the package's version and all its sources."""
    package = Path(paint_deposition.__file__).parent
    digest = hashlib.sha256(paint_deposition.__version__.encode())
    for file in sorted(package.rglob('*.py')):
        digest.update(str(file.relative_to(package)).encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()[:32]
