"""The files in config/: examples that work as they stand."""

import re

import pytest
import yaml

import paint_deposition as pd
from booth import SAMPLES
from paint_deposition.files.campaign_file import _Band, _Entry, _File
from paint_deposition.files.motion_files import MOTION_KINDS
from paint_deposition.files.zones_file import ZoneEntry

CONFIG = SAMPLES.parents[3] / 'config'


def test_model_is_the_default_one_and_readings_are_readings():
    assert pd.read_model(CONFIG / 'model.yaml') == pd.DepositionModel()
    readings = pd.read_readings(CONFIG / 'readings.csv')
    assert len(readings) == 3
    assert len(set(readings.point)) == 2
    text = (CONFIG / 'readings.csv').read_text()
    columns = 'x_m y_m z_m thickness_um point group layer sigma_um nx ny nz'
    assert all(re.search(rf'\b{name}\b', text) for name in columns.split())


@pytest.mark.slow
def test_campaign_names_every_key_and_can_be_read_with_all_of_them(tmp_path):
    text = (CONFIG / 'campaign.yaml').read_text()
    for key in (*_File.model_fields, *_Entry.model_fields):
        assert re.search(rf'^[ -]*(# )?(- )?{key}:', text, re.M), key
    text = text.replace('../ros2_ws', str(CONFIG.parent / 'ros2_ws'))
    text = re.sub(r'^    # (\w+: )', r'    \1', text, flags=re.M).replace('0.001', '1.0')
    text = text.replace('points.csv', str(SAMPLES / 'measured_door' / 'door.csv'))
    text = text.replace('zones.yaml', str(CONFIG / 'zones.yaml'))
    text = re.sub(r'^ *sheet: .*\n', '', text, flags=re.M)  # a CSV file has no sheets
    entries = yaml.safe_load(text)['experiments']
    # Keys of other kinds of motion stand by themselves: no recording has them all.
    others = {'sheet', 'frame_id', 'tool_axis', 'guns', 'coats', *_Band.model_fields}
    others = others | {*MOTION_KINDS} - {'pose_topic', 'state_topic'}
    assert set(_Entry.model_fields) - others <= set(entries[-1])
    campaign = tmp_path / 'campaign.yaml'
    campaign.write_text(text)
    panel, door = pd.read_campaign(campaign).experiments
    assert (panel.name, door.name, panel.zones) == ('panel', 'door', None)
    assert set(door.zones.names) == {'foot', 'skin'}
    written = (CONFIG / 'zones.yaml').read_text()
    for key in ZoneEntry.model_fields:
        assert re.search(rf'^[ -]*(# )?{key}:', written, re.M), key
