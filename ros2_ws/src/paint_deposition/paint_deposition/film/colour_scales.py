"""Film and residual as colours, the same in viewers, files and pictures."""

import math
from dataclasses import dataclass

import numpy as np

# Perceptually uniform, dark blue to yellow; van der Walt and Smith, 2015, CC0.
VIRIDIS = bytes.fromhex(
    '44015444025645045745055946075a46085c460a5d460b5e470d60470e61471063471164471365481467481668'
    '48176948186a481a6c481b6d481c6e481d6f481f70482071482173482374482475482576482677482878482979'
    '472a7a472c7a472d7b472e7c472f7d46307e46327e46337f463480453581453781453882443983443a83443b84'
    '433d84433e85423f854240864241864142874144874045884046883f47883f48893e49893e4a893e4c8a3d4d8a'
    '3d4e8a3c4f8a3c508b3b518b3b528b3a538b3a548c39558c39568c38588c38598c375a8c375b8d365c8d365d8d'
    '355e8d355f8d34608d34618d33628d33638d32648e32658e31668e31678e31688e30698e306a8e2f6b8e2f6c8e'
    '2e6d8e2e6e8e2e6f8e2d708e2d718e2c718e2c728e2c738e2b748e2b758e2a768e2a778e2a788e29798e297a8e'
    '297b8e287c8e287d8e277e8e277f8e27808e26818e26828e26828e25838e25848e25858e24868e24878e23888e'
    '23898e238a8d228b8d228c8d228d8d218e8d218f8d21908d21918c20928c20928c20938c1f948c1f958b1f968b'
    '1f978b1f988b1f998a1f9a8a1e9b8a1e9c891e9d891f9e891f9f881fa0881fa1881fa1871fa28720a38620a486'
    '21a58521a68522a78522a88423a98324aa8325ab8225ac8226ad8127ad8128ae8029af7f2ab07f2cb17e2db27d'
    '2eb37c2fb47c31b57b32b67a34b67935b77937b87838b9773aba763bbb753dbc743fbc7340bd7242be7144bf70'
    '46c06f48c16e4ac16d4cc26c4ec36b50c46a52c56954c56856c66758c7655ac8645cc8635ec96260ca6063cb5f'
    '65cb5e67cc5c69cd5b6ccd5a6ece5870cf5773d05675d05477d1537ad1517cd2507fd34e81d34d84d44b86d549'
    '89d5488bd6468ed64590d74393d74195d84098d83e9bd93c9dd93ba0da39a2da37a5db36a8db34aadc32addc30'
    'b0dd2fb2dd2db5de2bb8de29bade28bddf26c0df25c2df23c5e021c8e020cae11fcde11dd0e11cd2e21bd5e21a'
    'd8e219dae319dde318dfe318e2e418e5e419e7e419eae51aece51befe51cf1e51df4e61ef6e620f8e621fbe723'
    'fde725'
)
# Diverging, blue over light grey to red; Moreland, Diverging Color Maps, 2009.
COOLWARM = bytes.fromhex(
    '3b4cc03c4ec23d50c33e51c53f53c64055c84257c94358cb445acc455cce465ecf485fd14961d24a63d34b64d5'
    '4c66d64e68d84f69d9506bda516ddb536edd5470de5572df5673e05875e15977e35a78e45b7ae55d7ce65e7de7'
    '5f7fe86180e96282ea6384eb6485ec6687ed6788ee688aef6a8bef6b8df06c8ff16e90f26f92f37093f37295f4'
    '7396f57597f67699f6779af7799cf87a9df87b9ff97da0f97ea1fa80a3fa81a4fb82a6fb84a7fc85a8fc86a9fc'
    '88abfd89acfd8badfd8caffe8db0fe8fb1fe90b2fe92b4fe93b5fe94b6ff96b7ff97b8ff98b9ff9abbff9bbcff'
    '9dbdff9ebeff9fbfffa1c0ffa2c1ffa3c2fea5c3fea6c4fea7c5fea9c6fdaac7fdabc8fdadc9fdaec9fcafcafc'
    'b1cbfcb2ccfbb3cdfbb5cdfab6cefab7cff9b9d0f9bad0f8bbd1f8bcd2f7bed2f6bfd3f6c0d4f5c1d4f4c3d5f4'
    'c4d5f3c5d6f2c6d6f1c7d7f0c9d7f0cad8efcbd8eeccd9edcdd9eccedaebcfdaead1dae9d2dbe8d3dbe7d4dbe6'
    'd5dbe5d6dce4d7dce3d8dce2d9dce1dadce0dbdcdedcdddddddcdcdedcdbdfdbd9e0dbd8e1dad6e2dad5e3d9d3'
    'e4d9d2e5d8d1e6d7cfe7d7cee8d6cce9d5cbead5c9ead4c8ebd3c6ecd3c5edd2c3edd1c2eed0c0efcfbfefcebd'
    'f0cdbbf1cdbaf1ccb8f2cbb7f2cab5f2c9b4f3c8b2f3c7b1f4c6aff4c5adf5c4acf5c2aaf5c1a9f5c0a7f6bfa6'
    'f6bea4f6bda2f7bca1f7ba9ff7b99ef7b89cf7b79bf7b599f7b497f7b396f7b194f7b093f7af91f7ad90f7ac8e'
    'f7aa8cf7a98bf7a889f7a688f6a586f6a385f6a283f5a081f59f80f59d7ef59c7df49a7bf4987af39778f39577'
    'f39475f29274f29072f18f71f18d6ff08b6ef08a6cef886bee8669ee8468ed8366ec8165ec7f63eb7d62ea7b60'
    'e97a5fe9785de8765ce7745be67259e57058e46e56e36c55e36b54e26952e16751e0654fdf634ede614ddd5f4b'
    'dc5d4ada5a49d95847d85646d75445d65244d55042d44e41d24b40d1493fd0473dcf453ccd423bcc403acb3e38'
    'ca3b37c83836c73635c53334c43032c32e31c12b30c0282fbe242ebd1f2dbb1b2cba162bb8122ab70d28b50927'
    'b40426'
)


TABLE = 256
# Rows of a palette behind the map's own colours.
UNDER, OVER, BARE = TABLE, TABLE + 1, TABLE + 2
# None of them is near a colour of the maps, in CIELAB by 30 at least.
UNDER_RGB = (250, 153, 191)
OVER_RGB = (214, 38, 41)
BARE_RGB = (158, 158, 158)
NICE_STEPS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)


def _palette(table: bytes, under: tuple[int, int, int], over: tuple[int, int, int]) -> np.ndarray:
    colours = np.empty((TABLE + 3, 4), dtype=np.uint8)
    colours[:TABLE, :3] = np.frombuffer(table, dtype=np.uint8).reshape(TABLE, 3)
    colours[UNDER, :3], colours[OVER, :3], colours[BARE, :3] = under, over, BARE_RGB
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
        row[values < self.low] = UNDER
        row[values > self.high] = OVER
        row[~shown | np.isnan(values)] = BARE
        return row

    def rgba(self, values: np.ndarray, shown: np.ndarray) -> np.ndarray:
        """(V, 4) uint8 colours; see ``rows``."""
        return self.palette[self.rows(values, shown)]


def film_scale(film_um: np.ndarray, low_um: float = 0.0, high_um: float = 0.0) -> ColourScale:
    """The scale for a film [um]: fixed, or from 0 to a round figure if both ends are 0."""
    if low_um == 0.0 and high_um == 0.0:
        high_um = round_up(float(film_um.max(initial=0.0)))
    return ColourScale(low_um, high_um, FILM_PALETTE)


def residual_scale(residual_um: np.ndarray, largest_um: float = 0.0) -> ColourScale:
    """The scale for residuals [um], even about 0: fixed, or to a round figure if 0."""
    if largest_um == 0.0:
        largest_um = round_up(float(np.abs(residual_um).max(initial=0.0)))
    return ColourScale(-largest_um, largest_um, RESIDUAL_PALETTE)


def round_up(value: float) -> float:
    """The next round figure; 1 for 0, so that a scale has a width."""
    if value <= 0.0:
        return 1.0
    unit = 10.0 ** math.floor(math.log10(value))
    return next(step * unit for step in NICE_STEPS if step * unit >= value * (1.0 - 1e-9))
