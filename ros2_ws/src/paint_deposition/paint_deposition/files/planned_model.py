"""The model that passes were planned with: named in every file of a plan.

A plan lies in a folder with its ``model.yaml``; its bag holds a copy. Bag, RAPID module and
``plan.json`` hold the digest of the model, so that another ``model.yaml`` is not taken for it.
"""

import re
from dataclasses import dataclass
from pathlib import Path

from paint_deposition.effects.catalogue import load_unnamed_effect_file
from paint_deposition.errors import ModelError
from paint_deposition.files.atomic import read_file
from paint_deposition.files.model_file import ModelFile, read_model_file
from paint_deposition.files.provenance import model_digest
from paint_deposition.files.rapid.program import is_rapid
from paint_deposition.files.recordings.bag_files import custom_data

MODEL_FILE = 'model.yaml'
PLAN_FILE = 'plan.json'
IMPROVEMENT_FILE = 'improvement.json'
# The key of the digest in a bag's custom data and in plan.json.
DIGEST = 'model_sha256'
IN_JSON = re.compile(rf'"{DIGEST}":\s*"([0-9a-f]{{64}})"')
IN_RAPID = re.compile(r'!.*\bmodel\b.*\bsha256 ([0-9a-f]{64})', re.IGNORECASE)


@dataclass(frozen=True)
class PlannedModel:
    """What a motion says of its plan's model: where that should lie, and its digest."""

    path: Path
    digest: str

    def file(self) -> ModelFile | None:
        """The model, if it is still that of the plan."""
        if not self.path.is_file():
            return None
        file = read_model_file(self.path, load_unnamed_effect_file)
        return file if model_digest(file.model) == self.digest else None


def planned_model(motion: Path) -> PlannedModel | None:
    """The model of a plan's bag, module or table, None for a motion that was not planned."""
    folder = motion if motion.is_dir() else motion.parent
    digest = _digest(motion, folder)
    return PlannedModel(folder / MODEL_FILE, digest) if digest else None


def _digest(motion: Path, folder: Path) -> str:
    """Digest of the model that a motion was planned with, '' for none."""
    if not is_rapid(motion) and motion.suffix != '.csv':
        return custom_data(folder).get(DIGEST, '')
    files, pattern = [motion], IN_RAPID
    if not is_rapid(motion):
        plans = (PLAN_FILE, IMPROVEMENT_FILE) if motion.name == 'passes.csv' else ()
        files, pattern = [folder / name for name in plans], IN_JSON
    for file in filter(Path.is_file, files):
        found = pattern.search(read_file(file, ModelError).decode('utf-8', errors='replace'))
        return found[1] if found else ''
    return ''
