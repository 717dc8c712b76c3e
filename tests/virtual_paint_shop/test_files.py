"""What is written can be read back by others' tools, and gives nothing away."""

import json

import numpy as np
import pytest
import yaml
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from .files import write
from .gauge import layout
from .shop import generate

pytestmark = pytest.mark.slow


@pytest.fixture(scope='module')
def campaign():
    return generate(4, 'edge_build', experiments=('panel', 'door'), parcels=300_000, heldout=20)


@pytest.fixture(scope='module')
def folder(campaign, tmp_path_factory):
    return write(campaign, tmp_path_factory.mktemp('shop') / 'out').parent


def test_campaign_file_names_what_exists_and_hides_the_truth(campaign, folder):
    text = (folder / 'campaign.yaml').read_text()
    assert 'truth' not in text
    assert 'edge' not in text
    for entry in yaml.safe_load(text)['experiments']:
        for key in ('mesh', 'trajectory', 'measurements'):
            assert (folder / entry[key]).exists()
    assert json.loads((folder / 'truth' / 'truth.json').read_text())['id'] == 'edge_build'
    with pytest.raises(FileExistsError, match='not empty'):
        write(campaign, folder)


def test_bag_holds_the_log(campaign, folder):
    log = campaign.experiments[1].log
    poses, triggers = [], []
    types = get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([folder / 'door'], default_typestore=types) as bag:
        for connection, stamp, data in bag.messages():
            message = bag.deserialize(data, connection.msgtype)
            if connection.topic == '/atomizer/pose':
                p, q, t = message.pose.position, message.pose.orientation, message.header.stamp
                poses.append([t.sec * 10**9 + t.nanosec, p.x, p.y, p.z, q.x, q.y, q.z, q.w])
            else:
                triggers.append((stamp, message.data))
    poses = np.array(poses, dtype=object)
    assert np.array_equal(poses[:, 0].astype(np.int64), log.stamps_ns)
    assert np.allclose(poses[:, 1:4].astype(float), log.positions_m)
    assert np.allclose(poses[:, 4:].astype(float), log.quaternions_xyzw)
    assert np.array_equal([t[0] for t in triggers], log.trigger_stamps_ns)
    assert np.array_equal([t[1] for t in triggers], log.trigger_on)


@pytest.mark.parametrize('style', ['columns', 'rows', 'random'])
def test_layouts_stay_on_the_part_and_repeat(campaign, style):
    part = campaign.experiments[1].part
    spots = layout(part, style, 120, 30, np.random.default_rng(3))
    assert spots.x_m.size == 90
    assert spots.repeats.sum() == 120
    assert spots.repeats.max() == 3
    assert part.edge_distance(spots.x_m, spots.z_m).min() > 0.0125
