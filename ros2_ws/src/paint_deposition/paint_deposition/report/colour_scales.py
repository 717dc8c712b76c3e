"""Colours: of film and residual in viewers, files and pictures, and of charts and pages."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

# (256, 3) RGB: viridis, perceptually uniform, dark blue to yellow (van der Walt and Smith, 2015,
# CC0), and a diverging map, blue over light grey to red (Moreland, Diverging Color Maps, 2009).
VIRIDIS, COOLWARM = np.load(Path(__file__).with_name('colour_maps.npy'))
TABLE = 256
# Rows of a palette behind the map's own colours.
UNDER_ROW, OVER_ROW, BARE_ROW = TABLE, TABLE + 1, TABLE + 2
# None of them is near a colour of the maps, in CIELAB by 30 at least.
UNDER_RGB = (250, 153, 191)
OVER_RGB = (214, 38, 41)
BARE_RGB = (158, 158, 158)

# Of charts and pages.
INK = '#1f2933'
MUTED = '#616e7c'
GRID = '#e4e7eb'
BEFORE = '#9aa5b1'
ACCENT = '#00708c'
# Film below, within and above the target band, and bare metal; distinct to the colour-blind too.
BELOW, WITHIN, HIGH, BARE = '#3f6fb0', '#b9dcae', '#e07b1f', '#9e9e9e'
COMPONENTS = ('#d1701f', '#7a5195', '#4c9a2a')
# Models side by side; as many as can be distinguished.
MODELS = (ACCENT, *COMPONENTS, '#b5485f', '#8a7a2b')
# 95 % of normally distributed readings lie within so many standard deviations.
TWO_SIDED_95 = 1.96


def _palette(
    table: np.ndarray, under: tuple[int, int, int], over: tuple[int, int, int]
) -> np.ndarray:
    colours = np.empty((TABLE + 3, 4), dtype=np.uint8)
    colours[:TABLE, :3] = table
    colours[UNDER_ROW, :3], colours[OVER_ROW, :3], colours[BARE_ROW, :3] = under, over, BARE_RGB
    colours[:, 3] = 255
    colours.setflags(write=False)
    return colours


# (259, 4) RGBA: the map, then the colours for under, over and bare metal.
FILM_PALETTE = _palette(VIRIDIS, UNDER_RGB, OVER_RGB)
RESIDUAL_PALETTE = _palette(COOLWARM, (0, 150, 136), (255, 160, 0))


@dataclass(frozen=True)
class ColourScale:
    """Which value has which colour."""

    # Ends of the map, in the unit of the values; below and above are the palette's under and over
    # colours.
    low: float
    high: float
    palette: np.ndarray  # (259, 4) uint8 RGBA

    def rows(self, values: np.ndarray, shown: np.ndarray) -> np.ndarray:
        """(V,) row of the palette for each value (V,); bare where not ``shown`` (V,) bool."""
        share = (values - self.low) * (TABLE / (self.high - self.low))
        row = np.clip(np.nan_to_num(share), 0, TABLE - 1).astype(np.int16)
        row[values < self.low] = UNDER_ROW
        row[values > self.high] = OVER_ROW
        row[~shown | np.isnan(values)] = BARE_ROW
        return row

    def rgba(self, values: np.ndarray, shown: np.ndarray) -> np.ndarray:
        """(V, 4) uint8 colours; see ``rows``."""
        return self.palette[self.rows(values, shown)]


def film_scale(film_um: np.ndarray, low_um: float = 0.0, high_um: float = 0.0) -> ColourScale:
    """The scale for a film [um]: fixed, or around the film between round figures if both are 0.

    It begins at 0 unless the whole film is thicker than a quarter of its peak.
    """
    if low_um == 0.0 and high_um == 0.0:
        least, most = float(film_um.min(initial=np.inf)), float(film_um.max(initial=0.0))
        if least <= 0.25 * most or not len(film_um):
            return ColourScale(0.0, round_up(most), FILM_PALETTE)
        # Its ends are multiples of one of these, about eight of them apart.
        step = round_up(max(most - least, 0.01 * most) / 8, (1.0, 2.0, 5.0, 10.0))
        first = math.floor(least / step)
        low_um, high_um = step * first, step * max(math.ceil(most / step), first + 1)
    return ColourScale(low_um, high_um, FILM_PALETTE)


def residual_scale(greatest_um: float, fixed_um: float = 0.0) -> ColourScale:
    """The scale for residuals of this size [um], even about 0: fixed, or to a round figure."""
    largest_um = fixed_um or round_up(greatest_um)
    return ColourScale(-largest_um, largest_um, RESIDUAL_PALETTE)


def round_up(
    value: float, figures: tuple[float, ...] = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
) -> float:
    """The next round figure; 1 for 0, so that a scale has a width."""
    if value <= 0.0:
        return 1.0
    unit = 10.0 ** math.floor(math.log10(value))
    return next(step * unit for step in figures if step * unit >= value * (1.0 - 1e-9))
