"""Points on a part at which the film is wanted, with what the part is like there.

Also which way a part faces and which way it hangs, for open sheets and closed bodies.
"""

from typing import Any

import numpy as np
import scipy

from paint_deposition.kernel.blocks import Blocks, bounding_box_m, box_centre_m

# Mean normals shorter than this share cancel, as on a closed body: they name no side.
CANCELLED = 0.1
# Parts whose mean normal is longer have their surface on one side, give or take a flange.
ONE_SIDED = 0.5
# A part whose mean normal leans less than this from the horizontal plane stands.
STANDING_COSINE = 0.7


def outward_side(
    normals: np.ndarray,
    areas_m2: np.ndarray | None,
    down: np.ndarray,
    gun_side: np.ndarray | None = None,
) -> np.ndarray:
    """(3,) unit mean of the (V, 3) normals, weighted by (V,) areas, on the painted side.

    On a closed body it is the mean over the surface that faces the gun, found from roughly where
    the gun is (``gun_side``, any length): on a part that has sides any motion before one gives the
    same, to the last bit. Where the normals cancel and no gun is known, it is -y, or z.
    """
    mean = mean_normal(normals, areas_m2)
    length = np.linalg.norm(mean)
    if gun_side is not None and len(normals) and length < ONE_SIDED:
        # From the nearest of 26 directions, until the mean settles.
        direction = np.rint(1.2 * gun_side / np.abs(gun_side).max())
        direction /= np.linalg.norm(direction)
        chosen = None
        for _ in range(32):
            # Surface of the side that the gun paints leans less than this from the side's mean.
            about = normals @ direction > 0.5
            if not about.any() or (chosen is not None and np.array_equal(about, chosen)):
                break
            chosen = about
            direction = mean_normal(normals[about], None if areas_m2 is None else areas_m2[about])
            direction /= np.linalg.norm(direction)
        return direction
    if length > CANCELLED:
        return mean / length
    return np.array([0.0, -1.0, 0.0]) if abs(down[1]) < 0.9 else np.array([0.0, 0.0, 1.0])


def mean_normal(normals: np.ndarray, areas_m2: np.ndarray | None) -> np.ndarray:
    """(3,) mean of the (V, 3) normals, of length 1 on a plane and 0 on a closed body."""
    return np.average(normals, axis=0, weights=areas_m2) if len(normals) else np.zeros(3)


def gravity(
    vertices_m: np.ndarray, normals: np.ndarray, areas_m2: np.ndarray
) -> tuple[np.ndarray, str]:
    """Guess which way is down, (3,), and a note for the user where it is a guess, else ''.

    Down is -z. A part that lies in x-y does so in the booth, a hood or a roof, if it is away from
    the plane z = 0. In that plane it was drawn flat, and hangs: down is -y.
    """
    mean = mean_normal(normals, areas_m2)
    length = np.linalg.norm(mean)
    lies = abs(mean[2]) >= STANDING_COSINE * length
    if length <= CANCELLED:  # a closed body lies as a plate, not as a block
        spread = np.einsum('v,vi,vj->ij', areas_m2, normals, normals) / areas_m2.sum()
        shares, directions = np.linalg.eigh(spread)
        # Share of a closed body's surface along one direction that makes it a plate.
        lies = shares[-1] > 0.7 and abs(directions[2, -1]) >= STANDING_COSINE
    if not lies:
        return np.array([0.0, 0.0, -1.0]), ''
    # A part drawn flat is no further from that plane [m].
    if vertices_m[:, 2].min() - 0.1 <= 0.0 <= vertices_m[:, 2].max() + 0.1:
        return np.array([0.0, -1.0, 0.0]), (
            'the part lies in x-y at z = 0, as if drawn flat: gravity is taken along -y of the '
            'mesh; if it lies so in the booth, as a hood or a roof does, give down 0 0 -1'
        )
    return np.array([0.0, 0.0, -1.0]), (
        'the part lies, as a hood or a roof does: gravity is taken along -z of the mesh; if it '
        'hangs while it is painted, give down'
    )


def across_axis(outward: np.ndarray, down: np.ndarray) -> np.ndarray:
    """(3,) horizontal unit vector along the part, to the right as the gun sees it.

    On a part that lies flat it is the mesh's x axis, or y where x is vertical.
    """
    level = np.cross(outward, down)
    length = np.linalg.norm(level)
    # A part that leans less than this from the horizontal lies flat: its lean says not which side
    # is the right one [rad].
    if length > np.radians(3.0):
        return level / length
    axis = np.eye(3)[0] if abs(down[0]) < 0.9 else np.eye(3)[1]
    level = axis - (axis @ down) * down
    return level / np.linalg.norm(level)


def downhill_axis(outward: np.ndarray, down: np.ndarray) -> np.ndarray:
    """(3,) unit vector down along the part, at right angles to ``across_axis`` and ``outward``."""
    along = np.cross(across_axis(outward, down), outward)
    return along / np.linalg.norm(along)


DOWN = (0.0, 0.0, -1.0)


class SurfacePoints:
    """Points on a part's surface and their covariates; the costly ones are computed when used.

    Args:
        positions_m: (V, 3) [m].
        normals: (V, 3) outward unit normals.
        down: (3,) unit vector of gravity in the mesh frame.
        outward: (3,) mean outward unit normal of the part; default that of the points.
        centre_m, extent_m: (3,) centre and sides of the part's bounding box [m]; default those of
            the points.
        area_m2: (V,) surface that each point stands for, or None for gauge readings.
        neighbours: (V,) the points in the order of ``kernel.blocks.neighbours_together``; default:
            they are sorted when they are painted.
        covariates: those below; arrays or functions without arguments that return them. Default:
            flat, without edges, all sky, over the points themselves, without neighbours.
    """

    # (V,) k1 + k2 [1/m], positive where the surface is concave toward the gun.
    curvature_per_m: np.ndarray
    # (V,) distance to the nearest free edge [m], inf where the part has none.
    edge_distance_m: np.ndarray
    # (V,) cosine-weighted share of the hemisphere over the point that is not hidden.
    sky_view_factor: np.ndarray
    # (V,) 0 at the lowest point of the part to 1 at its highest.
    height_fraction: np.ndarray
    # (V, V) sparse derivative along gravity's component in the surface [1/m]: on surface that
    # leans by an angle a from the horizontal ``points.slope_per_m @ field`` is sin(a) times the
    # field's change per metre. Rows of points without neighbours are zero.
    slope_per_m: scipy.sparse.csr_matrix

    def __init__(
        self,
        positions_m: np.ndarray,
        normals: np.ndarray,
        *,
        down: np.ndarray | tuple[float, float, float] = DOWN,
        outward: np.ndarray | None = None,
        centre_m: np.ndarray | None = None,
        extent_m: np.ndarray | None = None,
        area_m2: np.ndarray | None = None,
        neighbours: np.ndarray | None = None,
        **covariates: Any,
    ) -> None:
        self.positions_m = np.ascontiguousarray(positions_m, dtype=np.float64)
        self.normals = np.ascontiguousarray(normals, dtype=np.float64)
        self.down = np.asarray(down, dtype=np.float64)
        if outward is None:
            outward = outward_side(self.normals, area_m2, self.down)
        self.outward = outward
        self.centre_m = box_centre_m(self.positions_m) if centre_m is None else centre_m
        if extent_m is None:
            low, high = bounding_box_m(self.positions_m)
            extent_m = high - low
        self.extent_m = extent_m
        self.area_m2 = area_m2
        self._neighbours = neighbours
        self._blocks: dict[type, Blocks] = {}
        count = len(self.positions_m)
        self._covariates: dict[str, Any] = {
            'curvature_per_m': lambda: np.zeros(count),
            'edge_distance_m': lambda: np.full(count, np.inf),
            'sky_view_factor': lambda: np.ones(count),
            'height_fraction': lambda: heights(self.positions_m, self.positions_m, self.down),
            'slope_per_m': lambda: scipy.sparse.csr_matrix((count, count)),
        }
        if strange := covariates.keys() - self._covariates:
            raise TypeError(f'{", ".join(strange)}: no covariate of points; there are: '
                            f'{", ".join(self._covariates)}')  # fmt: skip
        self._covariates |= {k: v for k, v in covariates.items() if v is not None}

    def __getattr__(self, name: str) -> Any:
        """A covariate that is used for the first time."""
        if name.startswith('_') or name not in self._covariates:
            raise AttributeError(f'points have no {name}')
        value = self._covariates[name]
        vars(self)[name] = value() if callable(value) else value
        return vars(self)[name]

    def __len__(self) -> int:
        return len(self.positions_m)

    def blocks(self, precision: type) -> Blocks:
        """The points as the kernel takes them; sorted once for all who paint them."""
        if precision not in self._blocks:
            self._blocks[precision] = Blocks.of(
                self.positions_m, self.normals, precision, self._neighbours
            )
        return self._blocks[precision]

    def __getstate__(self) -> dict:
        """Covariates are computed before points go to another process."""
        computed = {name: getattr(self, name) for name in self._covariates}
        return self.__dict__ | {'_covariates': computed, '_blocks': {}}

    def select(self, rows: np.ndarray | slice | list[int]) -> 'SurfacePoints':
        """The chosen rows (mask, slice or indices), covariates computed only if used.

        Slopes need neighbours: a row some of whose neighbours are not chosen has slope zero.
        """
        rows = np.arange(len(self))[rows]

        def slopes_among() -> scipy.sparse.csr_matrix:
            whole = self.slope_per_m[rows]
            inside = whole[:, rows]
            complete = np.diff(whole.indptr) == np.diff(inside.indptr)
            inside.data *= np.repeat(complete, np.diff(inside.indptr))
            inside.eliminate_zeros()
            return inside

        kept: dict[str, Any] = {
            name: lambda name=name: getattr(self, name)[rows] for name in self._covariates
        }
        return SurfacePoints(
            self.positions_m[rows], self.normals[rows], down=self.down, outward=self.outward,
            centre_m=self.centre_m, extent_m=self.extent_m,
            area_m2=None if self.area_m2 is None else self.area_m2[rows],
            **kept | {'slope_per_m': slopes_among},
        )  # fmt: skip


def angles_rad(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(N,) angles between vectors (N, 3), of any lengths."""
    across = np.linalg.norm(np.cross(one, other), axis=1)
    return np.arctan2(across, np.einsum('ij,ij->i', one, other))


def box_words(positions_m: np.ndarray) -> str:
    """'x 0.000 to 1.200, y 0.000 to 0.700, z ... m', the box around points (N, 3) [m]."""
    low, high = positions_m.min(axis=0).round(3) + 0.0, positions_m.max(axis=0).round(3) + 0.0
    sides = zip('xyz', low, high, strict=True)
    return ', '.join(f'{axis} {a:.3f} to {b:.3f}' for axis, a, b in sides) + ' m'


def heights(positions_m: np.ndarray, among_m: np.ndarray, down: np.ndarray) -> np.ndarray:
    """(N,) heights of (N, 3) positions, 0 at the lowest of (V, 3) others to 1 at the highest."""
    height, others = -positions_m @ down, -among_m @ down
    extent = np.ptp(others) if len(others) else 0.0
    return (height - others.min()) / extent if extent else np.zeros(len(height))
