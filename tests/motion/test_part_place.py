"""The pose of a part from touched points and from a scan: found where it was put."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.motion.part_location import locate, register

POSE = Rigid.of([2.1, -0.4, 0.9, *Rotation.from_euler('ZYX', [1.9, 0.3, -0.2]).as_quat()])
POINTS = {
    'P1': np.array([0.0, 0.0, 0.0]), 'P2': np.array([1.1, 0.0, 0.02]),
    'P3': np.array([1.05, 0.1, 0.7]), 'P4': np.array([0.1, 0.08, 0.65]),
    'P5': np.array([0.5, -0.05, 0.3]),
}  # fmt: skip


def touched(noise_m: float = 0.0, *names: str) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(2)
    at = {name: POINTS[name] for name in names or POINTS}
    moved = POSE.applied(np.array(list(at.values())), np.tile([0.0, 0, 0, 1], (len(at), 1)))[0]
    return dict(zip(at, moved + noise_m * rng.normal(size=moved.shape), strict=True))


def apart(pose: Rigid) -> tuple[float, float]:
    """How far from where the part stands [m, rad]."""
    off = POSE.inverse() @ pose
    turned = Rotation.from_quat(off.quaternion_xyzw).magnitude()
    return float(np.linalg.norm(off.translation_m)), float(turned)


@pytest.mark.parametrize('names', [(), ('P1', 'P2', 'P4')])
def test_exact_points_give_the_pose(names):
    place = locate(touched(0.0, *names), POINTS)
    assert max(apart(place.pose)) < 1e-12
    assert place.rms_m < 1e-12
    assert list(place.residuals_m) == list(names or POINTS)
    assert place.warnings == ()


def test_noise_of_a_probe_shows_in_the_residuals():
    """0.3 mm on each axis: about 0.3 mm times the root of 3, less what the fit takes."""
    place = locate(touched(0.3e-3), POINTS)
    assert apart(place.pose)[0] < 1e-3
    assert 0.2e-3 < place.rms_m < 0.6e-3
    assert place.rms_m == pytest.approx(
        np.sqrt(np.mean(np.square(list(place.residuals_m.values()))))
    )
    assert place.warnings == ()


def test_a_wrong_point_is_named():
    points = touched(0.1e-3)
    points['P3'] = points['P3'] + [0.0, 0.03, 0.0]
    (warning,) = locate(points, POINTS).warnings
    assert warning.startswith('without P3 the others fit within 0.')


def test_points_that_fix_no_pose_are_refused():
    with pytest.raises(RecordingError, match='2 points in common'):
        locate({'P1': POINTS['P1'], 'P2': POINTS['P2'], 'Q': POINTS['P3']}, POINTS)
    line = {f'L{k}': np.array([0.3 * k, 0.1 * k, 0.001 * (k == 1)]) for k in range(4)}
    with pytest.raises(RecordingError, match='lie on a line'):
        locate(line, line)


def test_a_mirrored_frame_is_refused():
    mirrored = {name: at * [1.0, -1.0, 1.0] for name, at in touched(0.2e-3).items()}
    with pytest.raises(RecordingError, match='left-handed; turn the sign of one axis'):
        locate(mirrored, POINTS)


def test_millimetres_are_told_from_metres():
    with pytest.raises(RecordingError, match=r'the touched points .* millimetres'):
        locate({name: 1000.0 * at for name, at in touched().items()}, POINTS)
    with pytest.raises(RecordingError, match=r'the listed points .* millimetres'):
        locate(touched(), {name: 1000.0 * at for name, at in POINTS.items()})


def fender() -> trimesh.Trimesh:
    """A bowed sheet of 1 m by 0.6 m, lower and more bent to one end: no two sides are alike."""
    u, v = np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 25), indexing='ij')
    x, y = u - 0.5, (v - 0.5) * (0.6 - 0.15 * u)
    z = 0.12 * np.sin(2.2 * u) - 0.3 * (0.6 + u) * y**2 + 0.05 * u * y
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    corner = np.arange(41 * 25).reshape(41, 25)
    a, b = corner[:-1, :-1].ravel(), corner[1:, :-1].ravel()
    c, d = corner[1:, 1:].ravel(), corner[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return trimesh.Trimesh(vertices, faces, process=False)


def scanned(part: trimesh.Trimesh, noise_m: float, share: float = 1.0) -> trimesh.Trimesh:
    """The part where it stands, with the noise of a scanner, without one end of it."""
    rng = np.random.default_rng(5)
    scan = part.subdivide()
    middle = scan.triangles_center[:, 0]
    scan.update_faces(middle < np.quantile(middle, share))
    vertices, _ = POSE.applied(
        np.asarray(scan.vertices), np.tile([0.0, 0, 0, 1], (len(scan.vertices), 1))
    )
    return trimesh.Trimesh(vertices + noise_m * rng.normal(size=vertices.shape), scan.faces)


@pytest.mark.slow
def test_a_scan_is_laid_on_the_part():
    part = fender()
    place = register(scanned(part, 0.3e-3), part)
    off_m, off_rad = apart(place.pose)
    assert off_m < 0.5e-3
    assert off_rad < 2e-3
    assert 0.1e-3 < place.rms_m < 0.6e-3
    assert place.residuals_m['95 % of the points within'] < place.residuals_m['largest']
    assert place.warnings == ()


@pytest.mark.slow
def test_half_a_scan_finds_its_place_from_a_start():
    part = fender()
    near = POSE @ Rigid.of([0.03, -0.02, 0.02, *Rotation.from_rotvec([0.1, -0.05, 0.1]).as_quat()])
    place = register(scanned(part, 0.3e-3, share=0.55), part, near)
    off_m, off_rad = apart(place.pose)
    assert off_m < 1e-3
    assert off_rad < 2e-3


@pytest.mark.slow
def test_a_part_that_looks_the_same_turned_round_is_warned_of():
    part = trimesh.creation.box([1.0, 0.6, 0.2])
    place = register(scanned(part.subdivide(), 0.3e-3), part)
    assert place.rms_m < 1e-3
    assert any('poses fit alike' in warning for warning in place.warnings)


@pytest.mark.slow
def test_a_scan_of_something_else_is_warned_of():
    place = register(scanned(trimesh.creation.icosphere(2, 0.4), 0.0), fender())
    assert any('mm off the part' in warning for warning in place.warnings)
