"""Parameters of `deposition_simulator` alone."""

from __future__ import annotations

from paint_deposition.film.statistics import DEFAULT_PAINTED_ABOVE_UM
from paint_deposition.nodes.runtime.parameters import NodeParameter

THICKEST_UM = 10_000.0

SIMULATOR = (
    NodeParameter(
        'precision',
        'single',
        'Arithmetic on the mesh; single is good to a millionth of the peak [name]',
        choices=('single', 'double'),
        fixed_because='the film so far was summed in it; restart the node',
    ),
    NodeParameter(
        'color_min_um',
        0.0,
        'Film at the lower end of the colours; both ends 0: automatic [um]',
        low=0.0,
        high=THICKEST_UM,
    ),
    NodeParameter(
        'color_max_um',
        0.0,
        'Film at the upper end of the colours; both ends 0: automatic [um]',
        low=0.0,
        high=THICKEST_UM,
    ),
    NodeParameter(
        'painted_above_um',
        DEFAULT_PAINTED_ABOVE_UM,
        'Thinner film counts, and is shown, as bare metal [um]',
        low=0.0,
        high=THICKEST_UM,
    ),
    NodeParameter(
        'target_um', 0.0, 'Film wanted; 0: none [um]', low=0.0, high=THICKEST_UM
    ),
    NodeParameter(
        'target_tolerance_um',
        0.0,
        'Difference from the target that is allowed, either way [um]',
        low=0.0,
        high=THICKEST_UM,
    ),
    NodeParameter(
        'output_directory', 'runs', 'Where ~/save_film writes [path]', is_path=True
    ),
)  # fmt: skip
