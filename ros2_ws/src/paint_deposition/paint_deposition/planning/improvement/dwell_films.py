"""The film that the paint of each node lays, through the whole model."""

from dataclasses import dataclass

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator, after_film_effects
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.surface import Surface
from paint_deposition.planning.improvement.nodes import Nodes
from paint_deposition.planning.improvement.programme import Programme

# Sub-steps for the films of nodes may be coarser than for a film: 1e-3 of the peak at most.
STEPS_PER_SIGMA = 6.0


def sprayed_travel_m(programme: Programme, path: SprayPath) -> tuple[np.ndarray, np.ndarray]:
    """(M,) travel at each sub-step, and (M,) the opening that it belongs to: the last begun."""
    travel = programme.travel_at_m(path.stamp_ns)
    begins = np.array([opening.on_m for opening in programme.openings])
    return travel, np.maximum(np.searchsorted(begins, travel, side='right') - 1, 0)


@dataclass(frozen=True)
class NodeFilms:
    """Films at chosen points of the part.

    Attributes:
        per_density_um: (n, V) film for a density of paint of 1 s/m at each node.
        film_um: (V,) of the programme that they were made with.
    """

    per_density_um: np.ndarray
    film_um: np.ndarray


class FilmAtPoints:
    """Films at some points of a part, with the model's effects, the film's own included.

    Args:
        surface: the part. rows: the vertices at which the film is wanted.
        model: what the gun sprays.

    Attributes:
        step_m: longest travel of a sub-step [m].
    """

    def __init__(self, surface: Surface, rows: np.ndarray, model: DepositionModel) -> None:
        self.model = model
        self._surface, self._rows = surface, rows
        points = surface.points().select(rows)
        self._integrator = FilmIntegrator(points, model, occluder=surface.occluder)
        narrow = min(min(p.sigma1_m, p.sigma2_m) for p in model.patterns)
        self.step_m = max(model.max_step_m, narrow / STEPS_PER_SIGMA)
        self._settles = [e for e in model.effects if type(e).on_film is not Effect.on_film]

    def film_um(self, programme: Programme) -> np.ndarray:
        """(V,) film of a programme at the points [um]."""
        path, _ = spray_path(programme.trajectory(), max_step_m=self.step_m)
        self._integrator.reset()
        self._integrator.add(path)
        raw = self._integrator.raw_um
        return raw * self._settling(programme, path)

    def of_nodes(self, programme: Programme, nodes: Nodes, density: np.ndarray) -> NodeFilms:
        """Films for each node of a programme that was timed at a density of paint (n,) [s/m].

        Density is slowness times flow. The film is linear in it, but for effects that ask how
        fast the gun goes or how long ago it opened: they are taken as they are in this programme.
        """
        path, _ = spray_path(programme.trajectory(), max_step_m=self.step_m)
        travel, opening = sprayed_travel_m(programme, path)
        sprayed, rows = self._integrator.sprayed(path)
        hats = nodes.hats(travel[rows], opening[rows])
        shares = hats.multiply(1.0 / (hats @ density)[:, np.newaxis]).tocsc()
        films = np.empty((len(nodes), len(self._rows)))
        for node in range(len(nodes)):
            column = slice(shares.indptr[node], shares.indptr[node + 1])
            steps = shares.indices[column]
            part = sprayed.select(steps)
            self._integrator.reset()
            self._integrator.add_sprayed(part.with_(dwell_s=part.dwell_s * shares.data[column]))
            films[node] = self._integrator.raw_um
        films *= self._settling(programme, path)
        return NodeFilms(films, density @ films)

    def _settling(self, programme: Programme, path: SprayPath) -> np.ndarray | float:
        """(V,) film in the end over film that arrived; effects on the film need all of it."""
        if not self._settles:
            return 1.0
        everywhere = self._surface.points()
        whole = FilmIntegrator(everywhere, self.model, occluder=self._surface.occluder)
        whole.add(path)
        raw = whole.raw_um
        settled = after_film_effects(raw, self._settles, everywhere)
        return np.divide(settled, raw, out=np.ones(len(raw)), where=raw > 0.0)[self._rows]
