"""Panels as a STEP file (AP203), written entity by entity: what CAD programs export."""

import numpy as np

HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('panel.step','2026-01-01T00:00:00',(''),(''),'','','');
FILE_SCHEMA(('CONFIG_CONTROL_DESIGN'));
ENDSEC;
DATA;
"""


def step_panels(width, height, unit: str = '.MILLI.', names: tuple[str, ...] = ('panel',)) -> str:
    """Upright panels in x-z [units] that face -y, each further one beside the last."""
    lines: list[str] = []

    def add(text: str) -> str:
        lines.append(text)
        return f'#{len(lines)}'

    def triple(kind: str, values) -> str:
        return add(f"{kind}('',({','.join(f'{v:.6f}' for v in values)}))")

    def axes(place, z, x) -> str:
        of = [triple('CARTESIAN_POINT', place), triple('DIRECTION', z), triple('DIRECTION', x)]
        return add(f"AXIS2_PLACEMENT_3D('',{','.join(of)})")

    def panel(x0: float) -> str:
        corners = x0 * np.eye(3)[0] + np.array(
            [[0, 0, 0], [width, 0, 0], [width, 0, height], [0, 0, height]], dtype=float
        )
        points = [triple('CARTESIAN_POINT', corner) for corner in corners]
        vertices = [add(f"VERTEX_POINT('',{point})") for point in points]
        bounds = []
        for k, way in enumerate(np.roll(corners, -1, axis=0) - corners):
            length = np.linalg.norm(way)
            vector = add(f"VECTOR('',{triple('DIRECTION', way / length)},{length:.6f})")
            line = add(f"LINE('',{points[k]},{vector})")
            edge = add(f"EDGE_CURVE('',{vertices[k]},{vertices[(k + 1) % 4]},{line},.T.)")
            bounds.append(add(f"ORIENTED_EDGE('',*,*,{edge},.T.)"))
        loop = add(f"EDGE_LOOP('',({','.join(bounds)}))")
        bound = add(f"FACE_OUTER_BOUND('',{loop},.T.)")
        plane = add(f"PLANE('',{axes(corners[0], (0, -1, 0), (1, 0, 0))})")
        face = add(f"ADVANCED_FACE('',({bound}),{plane},.T.)")
        shell = add(f"OPEN_SHELL('',({face}))")
        return add(f"SHELL_BASED_SURFACE_MODEL('',({shell}))")

    length = add(f'( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT({unit},.METRE.) )')
    angle = add('( NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.) )')
    solid = add('( NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT() )')
    context = add(
        '( GEOMETRIC_REPRESENTATION_CONTEXT(3) '
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid})) REPRESENTATION_CONTEXT('','') )"
    )
    application = add("APPLICATION_CONTEXT('configuration controlled 3d design')")
    in_product = add(f"MECHANICAL_CONTEXT('',{application},'mechanical')")
    in_definition = add(f"DESIGN_CONTEXT('',{application},'design')")
    for number, name in enumerate(names):
        items = f'{axes((0, 0, 0), (0, 0, 1), (1, 0, 0))},{panel(1.5 * number * width)}'
        kind = 'MANIFOLD_SURFACE_SHAPE_REPRESENTATION'
        shape = add(f"{kind}('{name}',({items}),{context})")
        made = add(f"PRODUCT('{name}','{name}','',({in_product}))")
        formation = add(f"PRODUCT_DEFINITION_FORMATION('','',{made})")
        defined = add(f"PRODUCT_DEFINITION('design','',{formation},{in_definition})")
        shaped = add(f"PRODUCT_DEFINITION_SHAPE('','',{defined})")
        add(f'SHAPE_DEFINITION_REPRESENTATION({shaped},{shape})')
    data = '\n'.join(f'#{k}={text};' for k, text in enumerate(lines, start=1))
    return f'{HEAD}{data}\nENDSEC;\nEND-ISO-10303-21;\n'
