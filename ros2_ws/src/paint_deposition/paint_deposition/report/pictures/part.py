"""A part as a flat picture from the gun's side, with the gun's way over it."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.markers import MarkerStyle
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Affine2D

from paint_deposition.motion.path import SprayPath
from paint_deposition.part.half_edges import edges_of
from paint_deposition.part.surface import Surface
from paint_deposition.report.pictures.seen_faces import seen_faces
from paint_deposition.report.pictures.view import SNAP_COSINE, View
from paint_deposition.report.style import INK, MUTED

# Passes beside the part are shown as far off as the part is large; farther ones leave the picture.
MARGIN_IN_PARTS = 1.0
# Pixels along the longer side of the part, and how many of them contours may skip.
PIXELS, COARSER = 1200, 4
# Light from above left; how much a lean of the surface brightens or darkens it.
LIGHT, CONTRAST = (-0.45, 0.75), 0.9
GREY, DARKEST, BRIGHTEST = 0.78, 0.25, 1.0
PALE_HALO = [Stroke(linewidth=2.2, foreground='white', alpha=0.7), Normal()]
ARROWS_A_WIDTH = 3.0
WAY_OFF = '#3a4048'
HALO = [Stroke(linewidth=3.4, foreground=INK), Normal()]


@dataclass(frozen=True)
class PartPicture:
    """What a picture of H x W pixels shows of a part.

    Attributes:
        view: the directions of the picture.
        corners: (H, W, 3) vertices of the triangle in each pixel, the lowest row first.
        weights: (H, W, 3) of these vertices; NaN where there is no part.
        normals: (V, 3) of the surface.
        edges_m: (E, 2, 2) visible creases and free edges in the picture [m].
        low_m, high_m: (2,) corners of the part in the picture [m].
    """

    view: View
    corners: np.ndarray
    weights: np.ndarray
    normals: np.ndarray
    edges_m: np.ndarray
    low_m: np.ndarray
    high_m: np.ndarray

    @staticmethod
    def of(surface: Surface) -> 'PartPicture':
        """The part from the gun's side, gravity down."""
        view = View.of_front(surface.outward, surface.down)
        flat = view.flat(surface.vertices_m)
        low, high = flat.min(axis=0), flat.max(axis=0)
        width, height = np.maximum(PIXELS * (high - low) / (high - low).max(), 1).astype(int)
        step = (high - low) / (width, height)
        toward = surface.vertices_m @ view.toward
        nearest, weights, seen = seen_faces(
            flat, toward, surface.faces, low, step, int(height), int(width)
        )
        return PartPicture(
            view,
            surface.faces[np.maximum(nearest, 0)],
            weights,
            surface.normals,
            flat[_borders(surface.faces[seen])],
            low,
            high,
        )

    def spread(self, values: np.ndarray) -> np.ndarray:
        """(H, W) values of the vertices (V,) in each pixel, NaN where there is no part."""
        return np.einsum('hwk,hwk->hw', values[self.corners], self.weights)

    def window(self, spray: SprayPath) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corner of a picture of the part with its whole passes [m]."""
        low, high = self.low_m, self.high_m
        margin = MARGIN_IN_PARTS * (high - low).max()
        gun = self.view.flat(spray.position_m[spray.flow > 0.0])
        if len(gun):
            low = np.maximum(np.minimum(low, gun.min(axis=0)), low - margin)
            high = np.minimum(np.maximum(high, gun.max(axis=0)), high + margin)
        room = 0.03 * (high - low).max()
        return low - room, high + room

    def draw_pixels(self, axes: Axes, rgb: np.ndarray) -> None:
        """Colours (H, W, 3) uint8, or greys (H, W, 1), as they are: no light falls on them."""
        rgba = np.empty((*rgb.shape[:2], 4), dtype=np.uint8)
        rgba[:, :, :3] = rgb[:, :, :3]
        rgba[:, :, 3] = np.where(np.isfinite(self.weights[:, :, 0]), 255, 0)
        (left, bottom), (right, top) = self.low_m, self.high_m
        axes.imshow(
            rgba, extent=(left, right, bottom, top), origin='lower', interpolation='nearest'
        )  # fmt: skip
        axes.add_collection(LineCollection(list(self.edges_m), colors=INK, linewidths=0.8), False)

    def draw_relief(self, axes: Axes) -> None:
        """The bare part in grey, lit from above left."""
        lean = self.spread(self.normals @ (LIGHT[0] * self.view.right + LIGHT[1] * self.view.up))
        grey = np.clip(GREY * (1.0 + CONTRAST * np.nan_to_num(lean)), DARKEST, BRIGHTEST)
        self.draw_pixels(axes, (255.0 * grey).astype(np.uint8)[:, :, np.newaxis])

    def draw_contours(self, axes: Axes, film_um: np.ndarray, low: float, high: float) -> None:
        """Lines of equal film, (V,) at the vertices, at round figures between two films [um]."""
        levels = MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
        levels = levels[(levels > film_um.min()) & (levels < film_um.max())]
        film = self.spread(film_um)[::COARSER, ::COARSER]
        if not len(levels) or min(film.shape) < 2:
            return
        (left, bottom), (right, top) = self.low_m, self.high_m
        x, y = (
            start + (COARSER * np.arange(count) + 0.5) * (end - start) / pixels
            for start, end, count, pixels in zip(
                (left, bottom), (right, top), film.shape[::-1], self.weights.shape[1::-1],
                strict=True,
            )
        )  # fmt: skip
        lines = axes.contour(
            x, y, np.ma.masked_invalid(film), levels, colors=INK, linewidths=0.6, alpha=0.55
        )
        for label in axes.clabel(lines, fontsize=7.5, fmt='%g', inline_spacing=3):
            # Level, or labels on upright lines would read upward here and downward there.
            label.set(path_effects=PALE_HALO, rotation=0.0, transform_rotates_text=False)

    def dress(self, axes: Axes, low: np.ndarray, high: np.ndarray) -> None:
        """Axes with the coordinates of the mesh, to these corners [m]."""
        axes.set_aspect('equal')
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.spines[['top', 'right']].set_visible(False)
        axes.tick_params(colors=MUTED, labelsize=9)
        across, upward = self.view.labels
        axes.set_xlabel(across, color=MUTED)
        axes.set_ylabel(upward, color=MUTED, rotation=0, ha='right', va='center')
        # Axes of the mesh that point the other way are labelled with the mesh's own sign.
        if self.view.right.min() < -SNAP_COSINE:
            axes.xaxis.set_major_formatter(lambda value, _: f'{-value:g}')
        if self.view.up.min() < -SNAP_COSINE:
            axes.yaxis.set_major_formatter(lambda value, _: f'{-value:g}')


def _borders(faces: np.ndarray) -> np.ndarray:
    """(E, 2) edges with one triangle only: creases, where patches share no vertex, and rims."""
    edges, of_face = edges_of(faces)
    return edges[np.bincount(of_face.ravel(), minlength=len(edges)) == 1]


def draw_tool_path(
    axes: Axes, spray: SprayPath, view: View, low: np.ndarray, high: np.ndarray
) -> None:
    """Draw each pass as a line with its number and arrows, and the way between them dashed.

    Args:
        axes: on which one unit is 1 m.
        spray: the motion.
        view: the directions of the picture.
        low, high: (2,) corners of the picture [m].
    """
    on = spray.flow > 0.0
    apart_s = np.diff(spray.stamp_ns) * 1e-9 - 0.5 * (spray.dwell_s[1:] + spray.dwell_s[:-1])
    breaks = 1 + np.flatnonzero((on[1:] != on[:-1]) | (apart_s > 1e-3))
    number = 0
    for rows in np.split(np.arange(len(spray)), breaks):
        line = view.flat(spray.position_m[rows])
        if not on[rows].any():
            axes.plot(*line.T, color=WAY_OFF, linewidth=0.9, linestyle=(0, (3, 3)), alpha=0.8)
            continue
        number += 1
        axes.plot(*line.T, color='white', linewidth=1.7, path_effects=HALO)
        room = 0.02 * (high - low).max()
        shown = line[np.all((line > low + room) & (line < high - room), axis=1)]
        if len(shown) > 1:
            _draw_arrows(axes, shown, (high - low).max() / ARROWS_A_WIDTH)
            axes.annotate(
                str(number), shown[0], fontsize=8.5, color='white', ha='center', va='center',
                bbox={'boxstyle': 'circle,pad=0.25', 'facecolor': INK, 'edgecolor': 'white'},
            )  # fmt: skip


def _draw_arrows(axes: Axes, line: np.ndarray, every_m: float) -> None:
    """Arrow heads along a line, in its direction."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    count = max(1, round(along[-1] / every_m))
    for middle in along[-1] * (np.arange(count) + 0.5) / count:
        row = max(1, int(np.searchsorted(along, middle)))
        right, up = line[row] - line[row - 1]
        turn = Affine2D().rotate(float(np.arctan2(up, right)) - 0.5 * np.pi)
        axes.plot(
            *line[row], marker=MarkerStyle('^', transform=turn), markersize=9,
            markerfacecolor='white', markeredgecolor=INK, markeredgewidth=0.9,
        )  # fmt: skip
