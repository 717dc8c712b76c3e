"""A box as a STEP file (AP203), written entity by entity: what CAD programs export."""

from itertools import product

import numpy as np

HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('box.step','2026-01-01T00:00:00',(''),(''),'','','');
FILE_SCHEMA(('CONFIG_CONTROL_DESIGN'));
ENDSEC;
DATA;
"""
# Corners of the box's sides, in cyclic order about the outward normal; corner 4 x + 2 y + z.
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def step_box(size, unit: str = '.MILLI.', names: tuple[str, ...] = ('panel',)) -> str:
    """Boxes of this size [units], each further one beside the last along x."""
    lines: list[str] = []

    def add(text: str) -> str:
        lines.append(text)
        return f'#{len(lines)}'

    def direction(vector) -> str:
        return add(f"DIRECTION('',({','.join(f'{v:.6f}' for v in vector)}))")

    def point(place) -> str:
        return add(f"CARTESIAN_POINT('',({','.join(f'{v:.6f}' for v in place)}))")

    def axes(place, z, x) -> str:
        return add(f"AXIS2_PLACEMENT_3D('',{point(place)},{direction(z)},{direction(x)})")

    def body(name: str, origin) -> str:
        corners = [np.array(origin) + np.array(c) * size for c in product((0, 1), repeat=3)]
        vertices = [add(f"VERTEX_POINT('',{point(corner)})") for corner in corners]
        edges: dict[tuple[int, int], str] = {}
        faces = []
        for side in SIDES:
            bounds = []
            for a, b in zip(side, side[1:] + side[:1], strict=True):
                low, high = min(a, b), max(a, b)
                if (low, high) not in edges:
                    way = corners[high] - corners[low]
                    length = np.linalg.norm(way)
                    vector = add(f"VECTOR('',{direction(way / length)},{length:.6f})")
                    line = add(f"LINE('',{point(corners[low])},{vector})")
                    edges[low, high] = add(
                        f"EDGE_CURVE('',{vertices[low]},{vertices[high]},{line},.T.)"
                    )
                sense = '.T.' if a < b else '.F.'
                bounds.append(add(f"ORIENTED_EDGE('',*,*,{edges[low, high]},{sense})"))
            loop = add(f"EDGE_LOOP('',({','.join(bounds)}))")
            bound = add(f"FACE_OUTER_BOUND('',{loop},.T.)")
            one, two = corners[side[1]] - corners[side[0]], corners[side[2]] - corners[side[1]]
            normal = np.cross(one, two)
            place = axes(corners[side[0]], normal / np.linalg.norm(normal), one / max(abs(one)))
            plane = add(f"PLANE('',{place})")
            faces.append(add(f"ADVANCED_FACE('',({bound}),{plane},.T.)"))
        shell = add(f"CLOSED_SHELL('',({','.join(faces)}))")
        return add(f"MANIFOLD_SOLID_BREP('{name}',{shell})")

    length = add(f'( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT({unit},.METRE.) )')
    angle = add('( NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.) )')
    solid = add('( NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT() )')
    accuracy = add(f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-05),{length},'','')")
    context = add(
        f'( GEOMETRIC_REPRESENTATION_CONTEXT(3) GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({accuracy}))'
        f' GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid}))'
        " REPRESENTATION_CONTEXT('','') )"
    )
    application = add("APPLICATION_CONTEXT('configuration controlled 3d design')")
    product_context = add(f"MECHANICAL_CONTEXT('',{application},'mechanical')")
    definition_context = add(f"DESIGN_CONTEXT('',{application},'design')")
    for number, name in enumerate(names):
        shape = body(name, (number * (size[0] + 50.0), 0.0, 0.0))
        world = axes((0, 0, 0), (0, 0, 1), (1, 0, 0))
        item = add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('{name}',({world},{shape}),{context})")
        made = add(f"PRODUCT('{name}','{name}','',({product_context}))")
        formation = add(f"PRODUCT_DEFINITION_FORMATION('','',{made})")
        defined = add(f"PRODUCT_DEFINITION('design','',{formation},{definition_context})")
        shaped = add(f"PRODUCT_DEFINITION_SHAPE('','',{defined})")
        add(f'SHAPE_DEFINITION_REPRESENTATION({shaped},{item})')
    data = '\n'.join(f'#{k}={text};' for k, text in enumerate(lines, start=1))
    return f'{HEAD}{data}\nENDSEC;\nEND-ISO-10303-21;\n'
