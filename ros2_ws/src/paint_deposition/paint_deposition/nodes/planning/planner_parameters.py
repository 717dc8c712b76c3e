"""Parameters of `index_planner`."""

from __future__ import annotations

import math

from paint_deposition.nodes.runtime.model_parameters import model_parameters
from paint_deposition.nodes.runtime.parameters import (
    NodeParameter,
    direction,
    fixed,
    mesh_parameters,
    thickness,
)
from paint_deposition.planning.index_request import FASTEST_M_PER_S
from paint_deposition.planning.plan import DEFAULT_SMOOTHING_RADIUS_M

PLANNER = (
    *model_parameters(''),
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
        'Whether the gun is turned by 180 deg for every return pass; else it keeps its '
        'orientation and lays the same profile both ways [-]',
    ),
    *fixed(
        'passes are planned once, when the node starts; restart the node with the new value',
        *mesh_parameters(max_edge_length_m=0.02),
        NodeParameter(
            'direction',
            'horizontal',
            'How planned passes run on the part [name]',
            choices=('horizontal', 'vertical'),
        ),
        NodeParameter(
            'speed_m_per_s',
            0.3,
            'Speed of planned passes; 0: from target_um [m/s]',
            low=0.0,
            high=FASTEST_M_PER_S,
        ),
        thickness(
            'target_um',
            description='Mean film of planned passes where speed_m_per_s is 0 [µm]',
        ),
        NodeParameter(
            'index_m',
            0.0,
            'Distance between planned passes; 0: the most even [m]',
            low=0.0,
            high=10.0,
        ),
        NodeParameter(
            'smoothing_radius_m',
            DEFAULT_SMOOTHING_RADIUS_M,
            'What is finer than this on the part is not followed [m]',
            low=0.005,
            high=2.0,
        ),
        NodeParameter(
            'acceleration_m_per_s2',
            2.0,
            'Acceleration of the robot [m/s^2]',
            low=0.05,
            high=50.0,
        ),
        direction(
            'outward',
            'Direction from the part to the gun, any length; empty: the mean normal [-]',
        ),
    ),
)
