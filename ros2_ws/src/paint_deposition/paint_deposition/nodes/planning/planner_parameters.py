"""Parameters of `index_planner`."""

from __future__ import annotations

import math

from paint_deposition.nodes.painting.painting_parameters import is_direction
from paint_deposition.nodes.runtime.parameters import NodeParameter
from paint_deposition.planning.index_request import FASTEST_M_PER_S
from paint_deposition.planning.plan import DEFAULT_SMOOTHING_RADIUS_M

AT_START = 'passes are planned once, when the node starts; restart the node with the new value'

RECOMMENDING = (
    NodeParameter(
        'model_file',
        '',
        'Deposition model, model.yaml; empty: a 50 mm bell. Setting it, to the same file too, '
        'reads it [path]',
        is_path=True,
    ),
    NodeParameter(
        'width_m',
        0.0,
        'Width to paint where a request gives none; 0: none [m]',
        low=0.0,
        high=100.0,
    ),
    NodeParameter(
        'length_m',
        0.0,
        'Length of a pass, for the cycle time; 0: as long as the width [m]',
        low=0.0,
        high=100.0,
    ),
    NodeParameter(
        'standoff_m',
        0.0,
        'Distance of the TCP from the part; 0: the part lies on the model plane [m]',
        low=0.0,
        high=5.0,
    ),
    NodeParameter(
        'travel_rad',
        0.0,
        "Direction of the first pass in the tool's x-y frame, from x to y [rad]",
        low=-2.0 * math.pi,
        high=2.0 * math.pi,
    ),
    NodeParameter(
        'gun_turns',
        False,
        'Whether the gun is turned by 180 deg for every way back; else it keeps its orientation '
        'and lays the same profile both ways [-]',
    ),
)

PLANNING = (
    NodeParameter(
        'mesh_file',
        '',
        "The part's mesh to plan passes on: STL, PLY or OBJ; empty: none [path]",
        is_path=True,
        fixed_because=AT_START,
    ),
    NodeParameter(
        'mesh_scale',
        1.0,
        'Metres for one unit of the mesh file; 0.001 for a mesh in mm [m]',
        low=1e-9,
        high=1e3,
        fixed_because=AT_START,
    ),
    NodeParameter(
        'max_edge_length_m',
        0.02,
        'Triangles are split until no edge is longer [m]',
        low=1e-4,
        high=10.0,
        fixed_because=AT_START,
    ),
    NodeParameter(
        'frame_id',
        'part',
        'Frame of the mesh and of the planned path [name]',
        constraints='a name',
        allows=lambda value: bool(value.strip('/')),
        fixed_because=AT_START,
    ),
    NodeParameter(
        'direction',
        'horizontal',
        'How planned passes run on the part [name]',
        choices=('horizontal', 'vertical'),
        fixed_because=AT_START,
    ),
    NodeParameter(
        'speed_m_per_s',
        0.3,
        'Speed of planned passes; 0: from target_um [m/s]',
        low=0.0,
        high=FASTEST_M_PER_S,
        fixed_because=AT_START,
    ),
    NodeParameter(
        'target_um',
        0.0,
        'Mean film of planned passes where speed_m_per_s is 0 [um]',
        low=0.0,
        high=10_000.0,
        fixed_because=AT_START,
    ),
    NodeParameter(
        'index_m',
        0.0,
        'Distance between planned passes; 0: the most even [m]',
        low=0.0,
        high=10.0,
        fixed_because=AT_START,
    ),
    NodeParameter(
        'smoothing_radius_m',
        DEFAULT_SMOOTHING_RADIUS_M,
        'What is finer than this on the part is not followed [m]',
        low=0.005,
        high=2.0,
        fixed_because=AT_START,
    ),
    NodeParameter(
        'acceleration_m_per_s2',
        2.0,
        'Acceleration of the robot [m/s^2]',
        low=0.05,
        high=50.0,
        fixed_because=AT_START,
    ),
    NodeParameter(
        'outward',
        [],
        'Direction from the part to the gun, any length; empty: the mean normal [-]',
        constraints='three numbers that are not all zero, or none',
        allows=is_direction,
        element=float,
        fixed_because=AT_START,
    ),
)

PLANNER = (*RECOMMENDING, *PLANNING)
