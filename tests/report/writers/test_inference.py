"""Residuals as coloured meshes."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.colour_scales import BARE_RGB
from paint_deposition.inference.comparison.comparison import compare
from paint_deposition.inference.comparison.residual_field import radius_of_readings_m
from paint_deposition.inference.fitting.study import Study
from paint_deposition.report.writers.inference import file_name, write_residual_meshes
from small_campaign import small_campaign


@pytest.mark.slow
def test_residuals_surround_their_readings_and_the_rest_is_grey(tmp_path):
    study = Study.of(small_campaign(tmp_path / 'campaign'))
    comparison = compare(study, DepositionModel())
    paths = write_residual_meshes(tmp_path, comparison)
    assert [path.name for path in paths] == ['residual_panel.ply', 'residual_door.ply']
    for number, (path, experiment) in enumerate(
        zip(paths, study.campaign.experiments, strict=True)
    ):
        residual = comparison.points.residual_um[study.campaign.experiment_of == number]
        mesh = trimesh.load_mesh(path, process=False)
        assert len(mesh.vertices) == len(experiment.surface.vertices_m)
        raw = mesh.metadata['_ply_raw']['vertex']['data']
        shown = np.asarray(raw['residual_um']).ravel()
        positions = experiment.measured_points.positions_m
        distance, nearest = cKDTree(positions).query(mesh.vertices)
        grey = np.all(mesh.visual.vertex_colors[:, :3] == BARE_RGB, axis=1)
        assert np.array_equal(grey, np.isnan(shown))
        assert np.all(grey[distance > radius_of_readings_m(positions)])
        close = (distance < 0.005) & ~grey
        assert close.any()
        reach = np.abs(residual).max()
        assert shown[close] == pytest.approx(residual[nearest[close]], abs=0.5 * reach)
        assert np.nanmax(np.abs(shown)) <= reach * (1.0 + 1e-6)


@pytest.mark.parametrize(
    ('name', 'file'), [('door', 'door'), ('Tür 2/left', 'Tür_2_left'), ('../..', 'experiment')]
)
def test_names_of_experiments_become_names_of_files(name, file):
    assert file_name(name) == file
