"""Forty parts over four days, alike but for an effect that grows from each morning to evening."""

import os
import time
from dataclasses import replace

import numpy as np
import pytest

import paint_deposition as pd
from inference.fitting.panels import reading
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.inference.diagnosis.procedure import diagnose
from paint_deposition.model.eq1_pattern import PlanarPattern
from small_campaign import generated, small_campaign
from virtual_paint_shop.draw import stream
from virtual_paint_shop.gauge import GaugeNoise, measure

PARTS, A_DAY, READINGS, TURNS = 40, 10, 36, 6
GREATEST = 0.8
DOOR = {
    'seed': 3, 'truth': 'faraday_shielding', 'amplitude': GREATEST, 'experiments': ('door',),
    'readings': READINGS, 'repeats': 0, 'heldout': 1, 'style': 'random', 'parcels': 2_000_000,
    'mesh_edge_m': 0.03,
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.skipif('PAINT_LONG' not in os.environ, reason='over a minute: make many')
def test_an_effect_that_grows_over_each_day_is_named_with_its_mean(tmp_path):
    (door,) = small_campaign(tmp_path, **DOOR).experiments
    painted = generated(**DOOR)
    shown = painted.experiments[0].readings
    parts = []
    for row in range(PARTS):
        share = row % A_DAY / (A_DAY - 1)
        film_um = shown.clean_um + share * (shown.expected_um - shown.clean_um)
        noise = GaugeNoise(level=0.015)
        read_um, *_ = measure(shown.point, film_um, film_um, noise, stream(row, 80))
        taken = reading(door, read_um).readings
        taken = taken.select(np.arange(READINGS) % TURNS == row % TURNS)
        parts.append(replace(door.with_readings(taken), name=f'part {row}'))
    pattern = painted.truth['pattern']
    planar = PlanarPattern(**{name: pattern[name] for name in PlanarPattern.model_fields})
    start = time.process_time()
    found = diagnose(pd.Campaign(tuple(parts)), pd.DepositionModel(planar=planar), EFFECTS)
    assert time.process_time() - start < 120.0  # of one core, on any machine
    assert found.accepted == ('faraday_shielding',)
    shielding = found.classes[0].parameters['shielding']
    assert shielding.low < GREATEST / 2 < shielding.high
