"""The record of samples: RAW and JPEG colours of the same surfaces under known settings."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.arrays import Array, Mask
from lutforge.errors import SampleError
from lutforge.samples.columns import (
    COLUMNS_OF,
    NUMBER_COLUMNS,
    OPTIONAL_COLUMNS,
    REQUIRED_COLUMNS,
    SHOT_COLUMNS,
    problem_in,
)
from lutforge.samples.table_file import Columns, write_columns
from lutforge.settings import setting_name

Text = NDArray[np.str_]


@dataclass(frozen=True, eq=False)
class SampleSet:
    """One sample a row: text columns (n,) numpy strings, `exposure_s` (n,), colours (n, 3) float64.

    raw: linear camera RGB before white balance, 0 = black level, 1 = saturation. srgb: the JPEG value / 255.
    wb: the white-balance multipliers with green = 1; NaN where unknown. exposure_s: NaN where unknown.
    raw_camera: the camera that the RAW is of; equal to `camera` unless a reference camera's RAW replaces it.
    position: (n, 2) x to the right and y down from the centre of the RAW's visible area, half its diagonal = 1; NaN
    where unknown. lens: its name, "" where unknown. focal_mm, aperture (f-number): (n,), NaN where unknown. d65_r,
    d65_b: (n,), the multipliers under which illuminant D65 is neutral, by the maker or LibRaw, green = 1; NaN where
    unknown.
    from_xyz: (n, 9), the rows of the matrix XYZ → RAW of any scale that LibRaw or a DNG file has; NaN where unknown.
    raw_space: where the linear values are no RAW, the RGB space in which they were encoded; "" for RAW. developer: the
    program whose pictures replace the RAW; chart, chart_light: the chart whose known colours do, and its light; "" for
    all else. dng_camera: the UniqueCameraModel of DNG files, "" of others. The columns from `position` on may be left
    out; they are unknown then. `from_arrays` fills in more. Raises SampleError where the columns differ in length.
    """

    camera: Text
    style: Text
    white_balance: Text
    shot: Text
    patch: Text
    exposure_s: Array
    raw: Array
    srgb: Array
    wb: Array
    raw_camera: Text
    position: Array = field(default_factory=lambda: np.zeros((0, 2)))
    lens: Text = field(default_factory=lambda: np.zeros(0, dtype=np.str_))
    focal_mm: Array = field(default_factory=lambda: np.zeros(0))
    aperture: Array = field(default_factory=lambda: np.zeros(0))
    d65_r: Array = field(default_factory=lambda: np.zeros(0))
    d65_b: Array = field(default_factory=lambda: np.zeros(0))
    from_xyz: Array = field(default_factory=lambda: np.zeros((0, 9)))
    raw_space: Text = field(default_factory=lambda: np.zeros(0, dtype=np.str_))
    developer: Text = field(default_factory=lambda: np.zeros(0, dtype=np.str_))
    chart: Text = field(default_factory=lambda: np.zeros(0, dtype=np.str_))
    chart_light: Text = field(default_factory=lambda: np.zeros(0, dtype=np.str_))
    dng_camera: Text = field(default_factory=lambda: np.zeros(0, dtype=np.str_))

    def __post_init__(self) -> None:
        count = len(self.camera)
        texts = ("lens", "raw_space", "developer", "chart", "chart_light", "dng_camera")
        for name in ("position", *SHOT_COLUMNS, "from_xyz", *texts):
            column = getattr(self, name)
            if len(column) == 0 < count:  # left out: unknown in every row
                unknown = np.nan if column.dtype.kind == "f" else ""
                object.__setattr__(self, name, np.full((count, *column.shape[1:]), unknown, dtype=column.dtype))
        widths = {"raw": (3,), "srgb": (3,), "wb": (3,), "position": (2,), "from_xyz": (9,)}
        for name in (column.name for column in fields(self)):
            shape = (count, *widths.get(name, ()))
            if getattr(self, name).shape != shape:
                raise SampleError(f"samples: column {name} has shape {getattr(self, name).shape}, not {shape}")

    @classmethod
    def from_arrays(
        cls,
        raw: ArrayLike,
        srgb: ArrayLike,
        *,
        camera: str,
        shot: ArrayLike,
        style: ArrayLike = "standard",
        white_balance: ArrayLike = "auto",
        patch: ArrayLike = "",
        exposure_s: ArrayLike = np.nan,
        wb: ArrayLike = np.nan,
    ) -> "SampleSet":
        """Make samples of arrays. A single value (a text, a number, one wb triple) is used for every sample.

        raw, srgb: (n, 3); wb: (3,) or (n, 3); the others a value or (n,); each as the class describes it.
        Raises SampleError where a column does not fit the number of samples, and where a value is not allowed.
        """
        linear, encoded = _as_numbers("raw", raw), _as_numbers("srgb", srgb)  # not repeated: each sample has its own
        count = len(np.atleast_1d(linear))
        if count == 0:
            raise SampleError("samples: none given")

        def column(name: str, values: ArrayLike, *width: int, dtype: type = float) -> NDArray[Any]:
            try:
                return np.array(np.broadcast_to(np.asarray(values, dtype), (count, *width)))
            except (TypeError, ValueError) as error:
                raise SampleError(f"samples: column {name} does not fit {count} samples: {error}") from error

        texts = {"camera": camera, "style": style, "white_balance": white_balance, "shot": shot, "patch": patch}
        for name, values in texts.items():
            if any(value is None for value in np.ravel(np.asarray(values, dtype=object))):
                raise SampleError(f"samples: column {name} is None; give a text")
        words = {name: column(name, values, dtype=str) for name, values in texts.items()}
        samples = cls(
            **words,
            raw=linear,
            srgb=encoded,
            exposure_s=column("exposure_s", exposure_s),
            wb=column("wb", wb, 3),
            raw_camera=words["camera"],
        )
        columns = {
            name: getattr(samples, group)[:, channel]
            for group, names in COLUMNS_OF.items()
            for channel, name in enumerate(names)
        }
        if (problem := problem_in({"exposure_s": samples.exposure_s, **columns})) is not None:
            raise SampleError(f"samples: row {problem[0]}: {problem[1]}")
        return samples

    def __repr__(self) -> str:
        cameras = ", ".join(np.unique(self.camera))
        return f"SampleSet({cameras}: samples {len(self)}, shots {len(np.unique(self.shot))})"

    def __len__(self) -> int:
        return len(self.camera)

    def save(self, path: str | Path) -> None:
        """Write the samples to a table, atomically; `lutforge.read_samples` reads it.

        .csv: UTF-8, 10 decimals; .npz: float64, one array a column. Raises SampleError on another suffix or an empty
        set, LutForgeError where the folder cannot be written to.
        """
        write_columns(Path(path), self._stored_columns())

    def _stored_columns(self) -> Columns:
        """The columns of a table, in order, without the optional ones of which nothing is known.

        `raw_camera` is left out, too, where no reference camera's RAW replaces the camera's.
        """
        columns: Columns = {name: values for name, values in vars(self).items() if name not in COLUMNS_OF}
        for name, group in COLUMNS_OF.items():
            columns |= {column: np.ascontiguousarray(getattr(self, name)[:, i]) for i, column in enumerate(group)}

        unknown = {
            name
            for name in OPTIONAL_COLUMNS
            if not (np.isfinite(columns[name]).any() if name in NUMBER_COLUMNS else np.any(columns[name] != ""))
        }
        if np.all(self.raw_camera == self.camera):
            unknown.add("raw_camera")
        return {name: columns[name] for name in (*REQUIRED_COLUMNS, *OPTIONAL_COLUMNS) if name not in unknown}

    @property
    def settings(self) -> Text:
        """White balances (n,), where "auto" is one of each shot: the camera may change it from shot to shot."""
        return np.where(self.white_balance == "auto", np.char.add("auto of ", self.shot), self.white_balance)

    @property
    def is_own_raw(self) -> bool:
        """True where nothing replaces the camera's own RAW."""
        replaced = (self.raw_camera != self.camera) | (self.developer != "") | (self.chart != "")
        return not np.any(replaced)

    def select(self, rows: Mask | NDArray[np.intp]) -> "SampleSet":
        """The rows of a mask or an index array."""
        return SampleSet(*(getattr(self, column.name)[rows] for column in fields(self)))

    def by_shot(self) -> Iterator[tuple[str, "SampleSet"]]:
        """Each shot with its samples, in order of first appearance."""
        names, first = np.unique(self.shot, return_index=True)
        for name in names[np.argsort(first)]:
            yield str(name), self.select(self.shot == name)


def _as_numbers(name: str, values: ArrayLike) -> Array:
    """The values of a column as an array of numbers. Raises SampleError where rows differ in length or hold text."""
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise SampleError(f"samples: column {name} is not an array of numbers: {error}") from error


def with_setting_names(samples: SampleSet) -> SampleSet:
    """The samples with style and white-balance names as selectors write them, whatever table they come from."""

    def named(column: Text) -> Text:
        names, index = np.unique(column, return_inverse=True)
        return np.array([setting_name(str(name)) for name in names], dtype=np.str_)[index]

    return replace(samples, style=named(samples.style), white_balance=named(samples.white_balance))


def concatenate(sets: Iterable[SampleSet]) -> SampleSet:
    """All rows of several sets, in order. Raises SampleError where there is none."""
    parts = list(sets)
    if not parts:
        raise SampleError("samples: none given")
    names = [column.name for column in fields(SampleSet)]
    return SampleSet(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
