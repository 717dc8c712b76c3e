"""What several commands are tried on."""

import numpy as np
import pytest
import trimesh

from cli.command import level_pass
from paint_deposition.files.recordings.bags import write_pose_bag


@pytest.fixture(scope='session')
def panel(tmp_path_factory):
    """A standing panel of 1.2 m by 0.8 m that looks to -y, as an STL."""
    corners = np.array([[-0.6, 0, -0.4], [0.6, 0, -0.4], [0.6, 0, 0.4], [-0.6, 0, 0.4]])
    path = tmp_path_factory.mktemp('panel') / 'panel.stl'
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False).export(path)
    return path


@pytest.fixture(scope='session')
def one_pass(tmp_path_factory):
    """A bag with one pass over the panel."""
    return write_pose_bag(tmp_path_factory.mktemp('bags') / 'one_pass', level_pass())
