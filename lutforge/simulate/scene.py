"""A scene as the simulated camera sees it: which surface is at each pixel, how it is lit, how glossy it is.

No spectral image is ever made: every pixel blends two surfaces of a short list, so its RAW value is the same blend of
their RAW values, times the light that falls there, plus a share of the light source itself (a highlight).
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lutforge.arrays import Array, Mask, Single
from lutforge.colour.spectra import chart_reflectances, surface_reflectances
from lutforge.simulate.camera import SimulatedCamera


@dataclass(eq=False)
class Scene:
    """Surfaces and their light, all images (h, w), painted back to front.

    reflectances: (K, L) in [0, 1] over `spectra.WAVELENGTHS`. first, second: indices into them; mix: the share of the
    second. shade: light relative to the scene's key light. gloss: mirrored light source, 1 = a perfect diffuser. x, y:
    places of the pixels, in picture heights, y points down. patches: centres (x, y) of a chart's 24 patches in pixels,
    (24, 2), or empty (0, 2); patch_side: their side.
    """

    reflectances: Array
    x: Array
    y: Array
    first: NDArray[np.int16]
    second: NDArray[np.int16]
    mix: Single
    shade: Single
    gloss: Single
    patches: Array = field(default_factory=lambda: np.empty((0, 2)))
    patch_side: float = 0.0

    @classmethod
    def blank(cls, height: int, width: int, reflectances: Array) -> "Scene":
        """The first surface everywhere, in full light."""
        y, x = np.mgrid[0:height, 0:width]
        first, second = np.zeros((2, height, width), dtype=np.int16)
        mix, gloss = np.zeros((2, height, width), dtype=np.float32)
        shade = np.ones((height, width), dtype=np.float32)
        return cls(reflectances, (x + 0.5) / height, (y + 0.5) / height, first, second, mix, shade, gloss)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        height, width = self.first.shape
        return height, width

    def irradiance(self, camera: SimulatedCamera, white_balance: str, exposure_s: float | None = None) -> Single:
        """E before lens and sensor: (h, w, 3), no noise, 1 = saturation, highlights beyond 1 not clipped."""
        surfaces = camera.expose(self.reflectances, white_balance, exposure_s).astype(np.float32)
        source = camera.expose(np.ones(self.reflectances.shape[1]), white_balance, exposure_s).astype(np.float32)
        first = surfaces[self.first]
        first += self.mix[..., None] * (surfaces[self.second] - first)
        first *= self.shade[..., None]
        first += self.gloss[..., None] * source
        return first

    def window(self, x: float, y: float, radius: float) -> "Scene":
        """The part within `radius` of (x, y), sharing this scene's pixels: paint small things fast."""
        height = self.shape[0]
        top, left = max(0, int((y - radius) * height)), max(0, int((x - radius) * height))
        area = slice(top, int((y + radius) * height) + 1), slice(left, int((x + radius) * height) + 1)
        images = ("x", "y", "first", "second", "mix", "shade", "gloss")
        return replace(self, **{image: getattr(self, image)[area] for image in images})

    def paint(
        self, mask: Mask, first: int, second: int | None = None, mix: Array | float = 0.0, shade: Array | float = 1.0
    ) -> None:
        """Cover the mask with a surface or a blend of two; `mix` and `shade`: numbers or images (h, w)."""
        self.first[mask] = first
        self.second[mask] = first if second is None else second
        self.mix[mask] = np.clip(np.broadcast_to(mix, mask.shape)[mask], 0, 1)
        self.shade[mask] = np.broadcast_to(shade, mask.shape)[mask]
        self.gloss[mask] = 0

    def darken(self, amount: Array) -> None:
        """Take away a share (h, w) of the light, 0 … 1."""
        self.shade *= (1 - amount).astype(np.float32)

    def soft_shadow(self, x: float, y: float, width: float, height: float, depth: float) -> None:
        """A contact shadow: an ellipse that fades out."""
        distance = ((self.x - x) / width) ** 2 + ((self.y - y) / height) ** 2
        self.darken(depth * np.exp(-(distance**0.8)))

    def card(self, x: float, y: float, width: float, height: float, angle: float) -> tuple[Mask, Array, Array]:
        """The mask of a tilted rectangle around (x, y), and its own coordinates u, v in [0, 1] (h, w)."""
        cosine, sine = np.cos(angle), np.sin(angle)
        u = ((self.x - x) * cosine + (self.y - y) * sine) / width + 0.5
        v = ((self.y - y) * cosine - (self.x - x) * sine) / height + 0.5
        return (u >= 0) & (u < 1) & (v >= 0) & (v < 1), u, v

    def chart(self, x: float, y: float, width: float, angle: float, shade: Array | float = 1.0) -> None:
        """A ColorChecker Classic: pitch 1, patches 0.86, frame 0.18; surfaces 0 … 23 are the patches."""
        pitch = width / 6.22
        mask, u, v = self.card(x, y, width, pitch * 4.22, angle)
        self.paint(mask, 23, shade=np.asarray(shade) * 0.8)
        column, row = u * 6.22 - 0.11, v * 4.22 - 0.11
        inside = (
            mask & (column >= 0) & (column < 6) & (row >= 0) & (row < 4)
            & (np.abs(column % 1 - 0.5) < 0.43) & (np.abs(row % 1 - 0.5) < 0.43)
        )  # fmt: skip
        index = (np.floor(row) * 6 + np.floor(column)).astype(np.int16)
        self.first[inside] = self.second[inside] = index[inside]
        self.shade[inside] = np.broadcast_to(shade, mask.shape)[inside]
        rows, columns = np.divmod(np.arange(24), 6)
        along, down = (columns + 0.5 - 3) * pitch, (rows + 0.5 - 2) * pitch
        cosine, sine = np.cos(angle), np.sin(angle)
        centres = np.column_stack([x + along * cosine - down * sine, y + along * sine + down * cosine])
        height = self.shape[0]
        self.patches, self.patch_side = centres * height - 0.5, 0.86 * pitch * height

    def ball(
        self, x: float, y: float, radius: float, first: int, second: int, mix: Array | float, gloss: float
    ) -> None:
        """A lit ball with contact and cast shadow and a highlight; the key light is at the upper left."""
        self.soft_shadow(x + 0.55 * radius, y + 0.93 * radius, 1.5 * radius, 0.3 * radius, 0.6)
        self.soft_shadow(x + 0.1 * radius, y + 0.98 * radius, 0.8 * radius, 0.14 * radius, 0.6)
        nx, ny = (self.x - x) / radius, (self.y - y) / radius
        mask = nx**2 + ny**2 < 1
        nz = np.sqrt(np.maximum(1 - nx**2 - ny**2, 0))
        facing = -0.5 * nx - 0.6 * ny + 0.6245 * nz  # the cosine to the key light, a unit vector
        bounce = 0.1 * np.maximum(ny, 0)
        self.paint(mask, first, second, mix, 0.12 + bounce + 0.85 * np.maximum(facing + 0.15, 0) / 1.15)
        halfway = -0.277 * nx - 0.333 * ny + 0.901 * nz
        shine = gloss * (np.maximum(halfway, 0) ** 120 + 0.04 * np.maximum(halfway, 0) ** 12)
        self.gloss[mask] += shine[mask].astype(np.float32)

    def vignetted(self, amount: float = 0.12) -> "Scene":
        """The scene with the vignetting of the lens towards the corners."""
        aspect = self.shape[1] / self.shape[0]
        radius = ((self.x - aspect / 2) ** 2 + (self.y - 0.5) ** 2) / (aspect**2 / 4 + 0.25)
        vignetting = (1 - amount * radius).astype(np.float32)
        return replace(self, shade=self.shade * vignetting, gloss=self.gloss * vignetting)


def palette(count: int, rng: np.random.Generator) -> Array:
    """Reflectances (24 + count, L): the chart's patches, then mixtures of up to three measured surfaces."""
    measured = np.vstack([chart_reflectances()[:18], surface_reflectances()])
    parts = rng.integers(0, len(measured), (count, 3))
    shares = rng.dirichlet((0.6, 0.4, 0.3), count)
    mixed = np.einsum("ns,nsl->nl", shares, measured[parts])
    mixed **= rng.uniform(0.7, 1.7, (count, 1))  # above 1 deepens the colour, below 1 bleaches it
    mixed *= rng.uniform(0.5, 1.1, (count, 1))
    return np.vstack([chart_reflectances(), np.clip(mixed, 0.0, 0.97)])


def smooth_noise(shape: tuple[int, int], grain: float, rng: np.random.Generator) -> Array:
    """Noise (h, w) of mean 0 and standard deviation about 1, whose blotches are `grain` pixels wide."""
    height, width = shape
    coarse = rng.normal(size=(int(height / grain) + 4, int(width / grain) + 4))
    rows, columns = np.arange(height) / grain + 1, np.arange(width) / grain + 1
    for place, order in (((rows, np.arange(coarse.shape[1])), 3), ((np.arange(height), columns), 1)):
        coarse = ndimage.map_coordinates(coarse, np.meshgrid(*place, indexing="ij"), order=order, mode="nearest")
    return coarse / 0.6
