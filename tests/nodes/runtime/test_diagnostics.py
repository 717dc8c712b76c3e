"""Diagnostics over real DDS."""

from paint_deposition.nodes.runtime.node import OK, WARN, PaintNode, Status


def test_every_task_reports_each_period(ros_context, spin, onlooker, wait_until):
    node = PaintNode(context=ros_context, namespace='cell1')
    calls = []

    def gun() -> Status:
        calls.append(1)
        return Status(WARN, f'call {len(calls)}', {'poses': 3, 'gap s': 0.5})

    node.report({'gun': gun, 'mesh': lambda: Status(OK, 'loaded')}, period_s=0.05)
    viewer = onlooker()
    spin(node)
    wait_until(lambda: len(viewer.heard['/diagnostics']) >= 3, what='diagnostics')
    first, later = (viewer.decoded('/diagnostics', row) for row in (0, 2))
    (gun_status, mesh_status), later_status = first.status, later.status[0]
    assert gun_status.name == 'cell1/paint_node: gun'
    assert mesh_status.name == 'cell1/paint_node: mesh'
    assert (gun_status.level, mesh_status.level) == (b'\x01', b'\x00')
    assert gun_status.hardware_id == '/cell1/paint_node'
    assert [(v.key, v.value) for v in gun_status.values] == [('poses', '3'), ('gap s', '0.5')]
    assert first.header.stamp.sec > 0
    assert later_status.message != gun_status.message
