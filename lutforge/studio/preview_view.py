"""Refinish preview: a photograph with other settings while the sliders move; wipe, histogram, clipping."""

import time
from base64 import b64encode
from dataclasses import dataclass
from io import BytesIO

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource
from numpy.typing import NDArray

from lutforge.apply.baked_grades import BakedGrades
from lutforge.apply.blocks import apply_to_pixels
from lutforge.apply.candidates import read_small
from lutforge.apply.source_settings import choose_camera, source_selector
from lutforge.arrays import Array, Pixels
from lutforge.errors import SettingsError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.white_balance import temperature_range
from lutforge.report.figures import CHANNELS
from lutforge.shots.picture_settings import read_picture_settings
from lutforge.studio.elements import Slider, Wipe, entry, frame, plot, select, text
from lutforge.studio.session import Session
from lutforge.studio.workspace import WorkspaceError


@dataclass(frozen=True, eq=False)
class Shown:
    """A graded preview.

    pixels: (h, w, 3) codes; histogram: (128, 3) shares; clipped: shares at 255 and at 0 in any channel; seconds: what
    grading took.
    """

    pixels: NDArray[np.uint8]
    histogram: Array
    clipped: tuple[float, float]
    seconds: float


class Preview:
    """One photograph under one profile; baked steps and grades are kept between changes."""

    def __init__(self, profile: CameraProfile, pixels: Pixels) -> None:
        self.profile = profile
        self.pixels = pixels
        self._baked_grades = BakedGrades()

    @staticmethod
    def kelvins(profile: CameraProfile) -> tuple[float, float] | None:
        """The temperatures that the profile can render; None where it knows too few."""
        try:
            return None if profile.raw_camera else temperature_range(profile.white_balances)
        except SettingsError:
            return None

    def show(self, source: str, target: str, ev: float = 0.0, overlay: bool = False) -> Shown:
        """The photograph, taken as `source`, as `target` and `ev` stops would have made it; overlay: mark clipping.

        Raises SettingsError on selectors that the profile does not know.
        """
        began = time.perf_counter()
        profile = self.profile
        given, wanted = profile.selector(source), profile.selector(target)
        if ev or str(given) != str(wanted):
            _, processor = self._baked_grades.refinish(profile, given, profile, wanted, ev)
            return _shown(_codes(apply_to_pixels(processor, self.pixels)), overlay, began)
        return _shown(self.original(), overlay, began)

    def original(self) -> NDArray[np.uint8]:
        """The photograph as it is."""
        return _codes(self.pixels)


def _codes(pixels: Pixels) -> NDArray[np.uint8]:
    return (np.clip(pixels, 0.0, 1.0) * np.float32(255) + np.float32(0.5)).astype(np.uint8)


def _shown(codes: NDArray[np.uint8], overlay: bool, began: float) -> Shown:
    thinned = codes[::2, ::2]
    counts = [np.bincount(thinned[..., c].ravel() // 2, minlength=128) for c in range(3)]
    white, black = (thinned == 255).any(axis=2), (thinned == 0).any(axis=2)
    if overlay:
        low, high = (codes == 0).any(axis=2), (codes == 255).any(axis=2)
        codes = codes.copy()
        # Violet over black, orange over white: told apart by colour-blind eyes.
        codes[low], codes[high] = (94, 60, 153), (230, 97, 1)
    histogram = np.stack(counts, axis=1) / (thinned.size / 3)
    return Shown(codes, histogram, (float(white.mean()), float(black.mean())), time.perf_counter() - began)


def data_url(codes: NDArray[np.uint8]) -> str:
    """A picture (h, w, 3) as a JPEG data URL."""
    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(codes).save(buffer, format="JPEG", quality=90, subsampling=0)
    return "data:image/jpeg;base64," + b64encode(buffer.getvalue()).decode("ascii")


IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff")
BY_TEMPERATURE = "by temperature"


class PreviewView:
    """The page's fourth view."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.preview: Preview | None = None
        self._quiet = False
        self.listed, self.path = select("Photograph in the folders", [""]), entry("or its path")
        opening = session.button("Show", self._open, button_type="primary")
        self.source, self.style = select("Taken as", [""]), select("Wanted style", [""])
        self.balance = select("Wanted white balance", [""])
        self.kelvin = Slider("Temperature", 5200, start=2000, end=10000, step=50, digits=0, unit=" K")
        self.tint = Slider("Tint", 0, start=-50, end=50, step=1, digits=0)
        self.ev = Slider("Exposure", 0, start=-3, end=3, step=0.05, unit=" EV")
        self.wipe = Slider("Wipe: before | after", 0.5)
        self.overlay = select("Clipping", {"as it is": False, "marked orange and violet": True})
        session.watch(self.show, self.kelvin, self.tint, self.ev)
        session.watch(self.show, self.source, self.style, self.balance, self.overlay)
        self.picture = Wipe(width_px=1000, height_px=604)
        self.wipe.jslink(self.picture, value="wipe")
        self.bins = ColumnDataSource({"x": [], "r": [], "g": [], "b": []})
        self.histogram = plot("", 246, 78, tools="")
        self.histogram.toolbar_location = None
        self.histogram.axis.visible = False
        for key, (_, colour, _) in zip("rgb", CHANNELS, strict=True):
            self.histogram.line("x", key, source=self.bins, color=colour, line_width=1.4)
        self.told = text(width=246)
        self.layout = pn.Row(
            pn.Column(
                self.listed, self.path, opening, self.source, self.style, self.balance, self.kelvin, self.tint,
                self.ev, self.wipe, self.overlay, self.histogram, self.told, width=256, height=628, scroll=True,
            ),
            self.picture,
        )  # fmt: skip

    def refresh(self) -> None:
        """The settings of the session's profile."""
        names = self.session.folders.files(IMAGE_SUFFIXES)
        self.listed.options = ["", *names]
        if not self.session.has_profile:
            return
        profile = self.session.profile
        self._quiet = True
        settings = [f"{style}/{balance}" for style in profile.styles for balance in profile.white_balances]
        for widget, values in ((self.source, settings), (self.style, list(profile.styles))):
            if widget is self.style or self.preview is None or self.preview.profile is not profile:
                widget.options = values
            if widget.value not in widget.options:
                widget.value = values[0]
        if self.preview is not None and self.preview.profile is not profile:
            self.preview = Preview(profile, self.preview.pixels)
        kelvins = Preview.kelvins(profile)
        balances = [*profile.white_balances, *([BY_TEMPERATURE] if kelvins else [])]
        self.balance.options = balances
        if self.balance.value not in balances:
            self.balance.value = balances[0]
        if kelvins is not None:
            self.kelvin.param.update(start=round(kelvins[0] + 50, -2), end=round(kelvins[1] - 50, -2))
            self.kelvin.value = min(max(self.kelvin.value, self.kelvin.start), self.kelvin.end)
        self._quiet = False
        self.show()

    def target(self) -> str:
        """The selector that the controls ask for."""
        tint = f"{self.tint.value:+g}" if self.tint.value else ""
        if self.balance.value == BY_TEMPERATURE:
            return f"{self.style.value}/{self.kelvin.value:g}K{tint}"
        return f"{self.style.value}/{self.balance.value}{tint}"

    def _open(self) -> None:
        path = self.session.folders.inside(self.path.value_input or self.path.value or self.listed.value)
        profile = self.session.profile
        self.preview = Preview(profile, read_small(path, 2_100_000))
        self.picture.before = data_url(self.preview.original())
        height, width = self.preview.pixels.shape[:2]
        told = f"{path.name}: {width} × {height} pixels in the preview; "
        settings = read_picture_settings(path)
        try:
            choose_camera(path, settings, {profile.camera.lower(): profile}, asked=False)
            given, notes = source_selector(path, settings, profile, None)
            self._quiet = True
            self.source.options = list(dict.fromkeys([*self.source.options, str(given)]))
            self.source.value = str(given)
            self._quiet = False
            self.session.say("; ".join([f"{told}taken as {given}, as its metadata say", *settings.notes, *notes]))
        except SettingsError as error:
            self.session.say(f"{told}choose what it was taken as ({error})")
        self.show()

    def show(self) -> None:
        """The photograph as the controls say."""
        by_temperature = self.balance.value == BY_TEMPERATURE
        self.kelvin.disabled = not by_temperature
        if self._quiet or self.preview is None:
            return
        try:
            shown = self.preview.show(self.source.value, self.target(), self.ev.value, self.overlay.value)
        except SettingsError as error:
            raise WorkspaceError(str(error)) from error
        self.picture.number += 1
        self.picture.after = data_url(shown.pixels)
        shares = shown.histogram**0.5
        axis = np.arange(len(shares)) / len(shares)
        self.bins.data = {"x": axis, "r": shares[:, 0], "g": shares[:, 1], "b": shares[:, 2]}
        frame(self.histogram, (0.0, 1.0), (0.0, max(float(shares[1:-1].max()), 1e-3)))
        white, black = shown.clipped
        megapixels = shown.pixels.shape[0] * shown.pixels.shape[1] / 1e6
        self.told.object = (
            f"<p>{white:.1%} clipped to white, {black:.1%} to black. Graded {megapixels:.1f} Mpixel in "
            f"{1000 * shown.seconds:.0f} ms.</p>"
        )
