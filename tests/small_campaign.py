"""A small campaign of the virtual paint shop: few parcels and readings, made in two seconds."""

from functools import cache
from pathlib import Path

import paint_deposition as pd
from virtual_paint_shop.files import write
from virtual_paint_shop.shop import generate

# Tests that ask for the same campaign share it.
generated = cache(generate)


def small_campaign(folder: Path, **options) -> pd.Campaign:
    """Panel and door with a strong hidden drift of the air, unless options say otherwise."""
    chosen = {
        'seed': 7, 'truth': 'air_drift', 'amplitude': 0.05, 'experiments': ('panel', 'door'),
        'readings': 40, 'repeats': 10, 'heldout': 1, 'style': 'columns', 'parcels': 100_000,
    } | options  # fmt: skip
    write(generated(**chosen), folder)
    return pd.read_campaign(folder / 'campaign.yaml')
