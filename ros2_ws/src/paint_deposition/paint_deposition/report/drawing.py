"""What all pictures share: figures and quiet axes, and a part as it is seen from the gun."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, TriMesh
from matplotlib.colorbar import Colorbar
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure, FigureBase
from matplotlib.patheffects import Normal, Stroke
from matplotlib.text import Annotation
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation
from scipy.spatial import cKDTree

from paint_deposition.errors import PaintError
from paint_deposition.files.atomic import replacing
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.edges import coarse_faces, edges_of
from paint_deposition.part.points import downhill_axis
from paint_deposition.part.refinement import face_normals
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import Zones
from paint_deposition.report.colour_scales import BEFORE, GRID, INK, MUTED, TABLE, ColourScale

DOTS_PER_INCH = 150
# Pictures of a page are as wide as a phone or half a sheet of paper [in], so that their lettering
# is that of the page.
PAGE_IN, TEXT_PT = 3.8, 8.0
MM = 1e3
PALE_HALO = [Stroke(linewidth=2.2, foreground='white', alpha=0.7), Normal()]
# Where a label of a point may stand [pt], the best place first.
AROUND_POINT = 9.0 * np.array(
    [(1, 1), (1, -1), (-1, 1), (-1, -1), (1.2, 0), (-1.2, 0), (0, 1.2), (0, -1.2)]
)
HALO = [Stroke(linewidth=3.4, foreground=INK), Normal()]
# A view this close to an axis of the mesh is along it and has the mesh's coordinates.
SNAP_COSINE = 0.9


@dataclass(frozen=True)
class View:
    """Directions of a picture in the mesh frame, unit vectors: right, up, and to the viewer."""

    right: np.ndarray
    up: np.ndarray
    toward: np.ndarray
    labels: tuple[str, str]  # names of the axes to the right and up

    @staticmethod
    def of_front(outward: np.ndarray, down: np.ndarray) -> 'View':
        """Along the mean normal, gravity downward; along the mesh's axes where it nearly is."""
        toward, down = _snapped(outward), _snapped(down)
        up = -down + (down @ toward) * toward
        if np.linalg.norm(up) < 0.1:  # a part seen from straight above, a hood: its front below
            up = -_snapped(downhill_axis(outward, down))
            up = up - (up @ toward) * toward
        up /= np.linalg.norm(up)
        right = np.cross(up, toward)
        return View(right, up, toward, (_name(right, 'right'), _name(up, 'up')))

    def others(self) -> tuple['View', 'View']:
        """Views from the right of this picture, and from its top with the front below."""
        (right, up), away = self.labels, _name(self.toward, 'away')
        return (
            View(-self.toward, self.up, self.right, (away, up)),
            View(self.right, -self.toward, self.up, (right, away)),
        )

    def flat(self, points_m: np.ndarray) -> np.ndarray:
        """(..., 2) where points (..., 3) lie in the picture [m]."""
        return np.stack([points_m @ self.right, points_m @ self.up], axis=-1)

    def dress(
        self, axes: Axes, low: np.ndarray | None = None, high: np.ndarray | None = None
    ) -> None:
        """Axes with the coordinates of the mesh, to these corners [m] if any."""
        axes.set_aspect('equal', adjustable='datalim' if low is None else None)
        if low is not None and high is not None:
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.spines[['top', 'right']].set_visible(False)
        axes.tick_params(colors=MUTED, labelsize=9)
        across, upward = self.labels
        axes.set_xlabel(across, color=MUTED)
        axes.set_ylabel(upward, color=MUTED, rotation=0, ha='right', va='center')
        # Axes of the mesh that point the other way are labelled with the mesh's own sign.
        for axis, direction in ((axes.xaxis, self.right), (axes.yaxis, self.up)):
            if direction.min() < -SNAP_COSINE:
                axis.set_major_formatter(lambda value, _: f'{0.0 - value:g}')


def _snapped(direction: np.ndarray) -> np.ndarray:
    largest = np.abs(direction).argmax()
    if abs(direction[largest]) < SNAP_COSINE:
        return direction
    return np.sign(direction[largest]) * np.eye(3)[largest]


def _name(direction: np.ndarray, otherwise: str) -> str:
    along = np.isclose(np.abs(direction), 1.0, atol=1e-9)
    return f'{"xyz"[along.argmax()] if along.any() else otherwise} [m]'


@dataclass(frozen=True)
class PartPicture:
    """What a picture shows of a part."""

    view: View  # the directions of the picture
    flat_m: np.ndarray  # (V, 2) places of the vertices in the picture [m]
    faces: np.ndarray  # (F, 3) triangles that look at the viewer, the farthest first
    seen: np.ndarray  # (F,) bool, those of them with nothing before their middle
    edges_m: np.ndarray  # (E, 2, 2) visible creases and free edges in the picture [m]

    @staticmethod
    def of(surface: Surface) -> 'PartPicture':
        """The part from the gun's side, gravity down."""
        view = View.of_front(surface.outward, surface.down)
        flat = view.flat(surface.vertices_m)
        front = face_normals(surface.vertices_m, surface.faces) @ view.toward > 0.0
        front = surface.faces[front]
        # A part of very many triangles is drawn with vertices two pixels apart.
        if len(front) > 200_000:
            front = coarse_faces(surface.vertices_m, front, np.ptp(flat, axis=0).max() / 500)
        faces = front[np.argsort((surface.vertices_m @ view.toward)[front].sum(axis=1))]
        # Whether a triangle is hidden is seen from a place so far above it [m].
        above = surface.vertices_m[faces].mean(axis=1) + 1e-3 * view.toward
        seen = surface.first_faces(above, np.tile(view.toward, (len(above), 1))) < 0
        # Creases, where patches share no vertex, and rims have one triangle only.
        edges, of_face = edges_of(faces[seen])
        edges = edges[np.bincount(of_face.ravel(), minlength=len(edges)) == 1]
        return PartPicture(view, flat, faces, seen, flat[edges])

    def window(self, spray: SprayPath | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corner of a picture of the part, with its whole passes if any [m]."""
        low, high = self.flat_m.min(axis=0), self.flat_m.max(axis=0)
        # Passes beside the part are shown as far off as the part is large.
        margin = (high - low).max()
        if spray is not None and (spray.flow > 0.0).any():
            gun = self.view.flat(spray.position_m[spray.flow > 0.0])
            low = np.maximum(np.minimum(low, gun.min(axis=0)), low - margin)
            high = np.minimum(np.maximum(high, gun.max(axis=0)), high + margin)
        room = 0.03 * (high - low).max()
        return low - room, high + room

    def on_page(self, low: np.ndarray, high: np.ndarray, title: str) -> tuple[Figure, Axes]:
        """A picture as wide as a page has room for, and its axes to these corners [m]."""
        across, upward = high - low
        # On a page a part is drawn no higher than this, with this room above and below [in].
        height = min((PAGE_IN - 0.8) * upward / across, 4.2)
        figure = new_figure(PAGE_IN, height + 1.3)
        axes = figure.subplots()
        self.view.dress(axes, low, high)
        axes.set_title(title, loc='left', fontsize=TEXT_PT + 1.0, color=INK)
        return figure, axes

    def draw(self, axes: Axes, rgba: np.ndarray) -> None:
        """The part in colours of its vertices, (V, 4) uint8: no light falls on them."""
        draw_triangles(axes, self.flat_m[self.faces], rgba[self.faces] / 255.0)
        self.draw_edges(axes)

    def zone_shares(self, zones: Zones) -> dict[int, np.ndarray]:
        """(V,) 1 in each zone and 0 outside, smoothed: its border is at a half, not by triangles.

        Zones that are not seen are left out.
        """
        seen = self.faces[self.seen]
        corners = np.bincount(seen.ravel(), minlength=len(self.flat_m))
        shares = {}
        for number in np.unique(zones.number[seen]).tolist():
            share = (zones.number == number).astype(float)
            for _ in range(3):  # over neighbours
                of_face = np.repeat(share[seen].mean(axis=1), 3)
                total = np.bincount(seen.ravel(), of_face, len(self.flat_m))
                share = np.divide(total, corners, out=share, where=corners > 0)
            shares[number] = share
        return shares

    def draw_zones(self, axes: Axes, zones: Zones | None, spray: SprayPath) -> None:
        """The borders of the zones of the vertices, with names and targets clear of the passes."""
        if zones is None:
            return
        middles = self.flat_m[self.faces[self.seen]].mean(axis=1)
        passes = self.view.flat(spray.position_m[spray.flow > 0.0])
        for number, share in self.zone_shares(zones).items():
            if number < 0:
                continue
            axes.tricontour(self.triangles(), share, [0.5], colors=INK, linewidths=1.4)
            own = share[self.faces[self.seen]].mean(axis=1) > 0.5
            if not own.any():
                continue
            obstacles = np.concatenate([passes, middles[~own], self.edges_m.mean(axis=1)])
            shape = np.array([5.0, 1.0])  # a label is so much wider than high
            away, _ = cKDTree(obstacles / shape).query(middles[own] / shape)
            zone = zones.zones[number]
            axes.annotate(
                f'{zone.name}  {zone.target_um:g} ± {zone.tolerance_um:g} µm',
                middles[own][np.argmax(away)], fontsize=8.5, color=INK, ha='center', va='center',
                zorder=5, path_effects=PALE_HALO,
            )  # fmt: skip

    def triangles(self) -> Triangulation:
        """The triangles that are seen."""
        return Triangulation(self.flat_m[:, 0], self.flat_m[:, 1], self.faces[self.seen])

    def draw_contours(self, axes: Axes, film_um: np.ndarray, low: float, high: float) -> None:
        """Lines of equal film, (V,) at the vertices, at round figures between two films [um]."""
        levels = MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
        levels = levels[(levels > film_um.min()) & (levels < film_um.max())]
        if not len(levels) or not self.seen.any():
            return
        lines = axes.tricontour(
            self.triangles(), film_um, levels, colors=INK, linewidths=0.6, alpha=0.55
        )
        for label in axes.clabel(lines, fontsize=7.5, fmt='%g', inline_spacing=3):
            # Level, or labels on upright lines would read upward here and downward there.
            label.set(path_effects=PALE_HALO, rotation=0.0, transform_rotates_text=False)

    def draw_edges(self, axes: Axes) -> None:
        """Visible creases and free edges."""
        axes.add_collection(LineCollection(list(self.edges_m), colors=INK, linewidths=0.8), False)


def draw_triangles(axes: Axes, corners_m: np.ndarray, rgba: np.ndarray) -> None:
    """Draw triangles (F, 3, 2) with colours (F, 3, 4) from 0 to 1 at their corners, in order."""
    x, y = corners_m.reshape(-1, 2).T
    triangles = Triangulation(x, y, np.arange(len(x)).reshape(-1, 3))
    # Corners of pictures are set by ``View.dress``: to look for them takes longer than to draw.
    axes.add_collection(
        TriMesh(triangles, facecolors=rgba.reshape(-1, 4), rasterized=True), autolim=False
    )


def label_points(
    axes: Axes, places_m: np.ndarray, words: Sequence[str], points_per_m: float, **style: Any
) -> None:
    """Write words beside places (n, 2) [m], each on the side with the most room.

    What is written on the axes already, such as the figures of contours, stays free.
    """
    places = points_per_m * places_m
    written = [text.get_position() for text in axes.texts if not isinstance(text, Annotation)]
    taken = [*places, *(points_per_m * np.array(written))]
    for row, (word, place) in enumerate(zip(words, places, strict=True)):
        others = np.array(taken[:row] + taken[row + 1 :] or [place + 1e3])
        spots = place + AROUND_POINT
        away = np.linalg.norm(spots[:, np.newaxis] - others, axis=2).min(axis=1)
        spot = spots[int(np.argmax(np.round(away)))]
        taken.append(spot)
        axes.annotate(
            word, place / points_per_m, spot - place, textcoords='offset points', ha='center',
            va='center', **style,
        )  # fmt: skip


def new_figure(
    width_in: float, height_in: float, layout: Literal['constrained'] | None = 'constrained'
) -> Figure:
    """An empty figure that draws into memory, without pyplot's global state.

    To lay many axes out takes as long as to draw them: with None they are placed by hand.
    """
    figure = Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, layout=layout)
    FigureCanvasAgg(figure)
    return figure


def quiet(axes: Axes, x_label: str, y_label: str, title: str = '', size: float = 10.0) -> None:
    """Thin grid, no box, labels in the muted colour and this size [pt]."""
    axes.grid(True, color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[['top', 'right']].set_visible(False)
    axes.spines[['left', 'bottom']].set_color(BEFORE)
    axes.tick_params(colors=MUTED, labelsize=size - 1.0)
    axes.set_xlabel(x_label, color=MUTED, fontsize=size)
    axes.set_ylabel(y_label, color=MUTED, fontsize=size)
    # A title that looks for its own height costs a third of the drawing.
    axes.set_title(title, loc='left', fontsize=size + 1.0, color=INK, y=1.0)


def legend(axes: Axes, **options: Any) -> None:
    """A legend without a frame."""
    axes.legend(frameon=False, fontsize=9, labelcolor=INK, **options)


def colour_bar(
    figure: FigureBase, axes: Sequence[Axes], label: str, scale: ColourScale, **place: Any
) -> Colorbar:
    """A bar of the colours beside all these axes; level and below them without a ``place``."""
    palette = ListedColormap(scale.palette[:TABLE] / 255.0)
    colours = ScalarMappable(Normalize(scale.low, scale.high), palette)
    place = place or {'location': 'bottom', 'shrink': 0.6, 'aspect': 30, 'pad': 0.04}
    bar = figure.colorbar(colours, ax=list(axes), **place)
    bar.set_label(label, color=MUTED)
    bar.ax.spines['outline'].set_visible(False)
    return bar


def save_picture(figure: Figure, path: str | Path) -> Path:
    """Write the figure as PNG, SVG or PDF, by the suffix, replacing an older file at once."""
    path = Path(path)
    if path.suffix not in ('.png', '.svg', '.pdf'):
        raise PaintError(f'{path}: give a picture a name that ends in .png, .svg or .pdf')
    with replacing(path) as temporary:
        figure.savefig(
            temporary, format=path.suffix.removeprefix('.'), dpi=DOTS_PER_INCH, facecolor='white'
        )
    return path
