"""Cases of the virtual paint shop as the package reads them, their noise drawn again and again."""

import csv
import json
import os
import shutil
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from tests.virtual_paint_shop.cases import Case, paint
from tests.virtual_paint_shop.files import write
from tests.virtual_paint_shop.gauge import Session, measure

from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.campaign_file import read_campaign
from paint_deposition.files.gauge_readings import read_readings
from paint_deposition.inference.diagnosis.sensitivities import neutral_shapes
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.least_squares import derivatives
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.readings import PointMeans
from paint_deposition.model.pattern import PlanarPattern
from paint_deposition.model.projection import Projection


@dataclass(frozen=True)
class Films:
    """What the shop knows of the readings of one part; arrays over its readings [um]."""

    point: np.ndarray
    film_um: np.ndarray
    expected_um: np.ndarray  # by a gauge without noise
    clean_um: np.ndarray  # without the hidden effects
    marks_um: np.ndarray  # (n, hidden) what each of them alone would change

    @staticmethod
    def read(path: Path) -> 'Films':
        with path.open(newline='') as file:
            _, *rows = csv.reader(file)
        values = np.array([row[1:] for row in rows], dtype=float)
        return Films(np.array([row[0] for row in rows]), *values[:, :3].T, values[:, 3:])


@dataclass(frozen=True)
class Draw:
    """A campaign with one draw of its noise."""

    campaign: Campaign
    sessions: tuple[Session, ...]


@dataclass(frozen=True)
class PaintedCase:
    """A case, the campaign of its first draw, and the films behind it."""

    case: Case
    folder: Path
    campaign: Campaign
    films: tuple[Films, ...]
    unseen: tuple[Films, ...]

    @staticmethod
    def of(case: Case, films: Path, parcels: int) -> 'PaintedCase':
        """Paint a case, or read what was painted before into the folder ``films``."""
        folder = films / f'{name_of(case)}-{parcels}'
        if not folder.exists():
            # Another process may paint the same case: the one that is ready first counts.
            own = folder.with_name(f'{folder.name}.{os.getpid()}')
            write(paint(case, parcels), own, sigma_column=case.stated)
            try:
                own.rename(folder)
            except OSError:
                shutil.rmtree(own)
        campaign = read_campaign(folder / 'campaign.yaml')
        tables = {
            kind: tuple(
                Films.read(folder / 'truth' / f'films_{kind}_{e.name}.csv')
                for e in campaign.experiments
            )
            for kind in ('readings', 'heldout')
        }
        return PaintedCase(case, folder, campaign, tables['readings'], tables['heldout'])

    def draw(self, number: int) -> Draw:
        """The campaign measured anew; the same number gives the same noise."""
        rng = np.random.default_rng([70, self.case.seed, number])
        sessions = tuple(
            measure(f.point, f.film_um, f.expected_um, self.case.noise, rng) for f in self.films
        )
        experiments = tuple(
            _read_anew(e, session.thickness_um)
            for e, session in zip(self.campaign.experiments, sessions, strict=True)
        )
        return Draw(replace(self.campaign, experiments=experiments), sessions)

    @cached_property
    def truth(self) -> dict:
        """What the shop wrote down of the campaign."""
        return json.loads((self.folder / 'truth' / 'truth.json').read_text())

    @cached_property
    def forward(self) -> Forward:
        """Predicts all points, those included that a diagnosis leaves out."""
        return Forward(self.campaign, _neutral())

    @cached_property
    def unseen_forward(self) -> Forward:
        """Predicts the readings that no diagnosis sees."""
        experiments = tuple(
            Experiment.of(
                e.name,
                e.surface,
                e.path,
                read_readings(self.folder / 'truth' / f'heldout_{e.name}.csv'),
            )
            for e in self.campaign.experiments
        )
        return Forward(Campaign(experiments), _neutral())

    @cached_property
    def pattern_um(self) -> np.ndarray:
        """(P, 7) change of the readings with the pattern, in standard deviations of its prior."""
        return self._slopes_um(self.forward)

    @cached_property
    def unseen_pattern_um(self) -> np.ndarray:
        """The same for the unseen readings."""
        return self._slopes_um(self.unseen_forward)

    @cached_property
    def pattern(self) -> DepositionModel:
        """The true pattern, and nothing else."""
        values = self.truth['pattern']
        planar = PlanarPattern(**{k: values[k] for k in PlanarPattern.model_fields})
        projection = Projection(
            model_plane_m=values['model_plane_m'], emission_offset_m=values['emission_offset_m']
        )
        return DepositionModel(planar=planar, projection=projection)

    def _slopes_um(self, forward: Forward) -> np.ndarray:
        parameters = FreeParameters.of(self.pattern)
        slopes = derivatives(
            forward,
            parameters,
            parameters.encode(parameters.start),
            np.ones(len(forward.campaign)),
        )
        return slopes * parameters.prior.width

    @property
    def passes(self) -> list[int]:
        """Number of passes over each part."""
        return [int(e.path.spray_pass.max()) + 1 for e in self.campaign.experiments]


def name_of(case: Case) -> str:
    """A name that no other case has."""
    return f'{case.seed}-{"+".join(case.truths) or "clean"}'.replace(':', '-')


def _neutral() -> tuple[Effect, ...]:
    """The library at neutral, so that one kernel serves all models."""
    return tuple(neutral_shapes(effect)[0] for effect in EFFECTS.values())


def _read_anew(experiment: Experiment, thickness_um: np.ndarray) -> Experiment:
    readings = replace(experiment.taken, thickness_um=thickness_um)
    return replace(experiment, readings=readings, means=PointMeans.of(readings), taken=readings)
