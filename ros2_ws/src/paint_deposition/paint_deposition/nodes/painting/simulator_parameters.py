"""Parameters of `deposition_simulator` alone."""

from __future__ import annotations

from paint_deposition.film.statistics import DEFAULT_PAINTED_ABOVE_UM
from paint_deposition.nodes.runtime.parameters import NodeParameter, thickness

SIMULATOR = (
    NodeParameter(
        'precision',
        'single',
        'Arithmetic on the mesh; single is good to a millionth of the peak [name]',
        choices=('single', 'double'),
        fixed_because='the film so far was summed in it; restart the node',
    ),
    thickness(
        'color_min_um',
        description='Film at the lower end of the colours; both ends 0: automatic [µm]',
    ),
    thickness(
        'color_max_um',
        description='Film at the upper end of the colours; both ends 0: automatic [µm]',
    ),
    thickness(
        'painted_above_um',
        default=DEFAULT_PAINTED_ABOVE_UM,
        description='Thinner film counts, and is shown, as bare metal [µm]',
    ),
    thickness('target_um', description='Film wanted; 0: none [µm]'),
    thickness(
        'target_tolerance_um',
        description='Difference from the target that is allowed, either way [µm]',
    ),
    NodeParameter('output_directory', 'runs', 'Where ~/save_film writes [path]', is_path=True),
)
