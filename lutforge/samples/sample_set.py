"""The sample table, its columns and their ranges: RAW and JPEG colours of the same surfaces under known settings."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.arrays import Array, Mask
from lutforge.errors import SampleError
from lutforge.settings import setting_name

TEXT_COLUMNS = ("camera", "style", "white_balance", "shot", "patch")
RAW_COLUMNS = ("raw_r", "raw_g", "raw_b")
SRGB_COLUMNS = ("srgb_r", "srgb_g", "srgb_b")
WB_COLUMNS = ("wb_r", "wb_g", "wb_b")
REQUIRED_COLUMNS = (*TEXT_COLUMNS, "exposure_s", *RAW_COLUMNS, *SRGB_COLUMNS)
POSITION_COLUMNS = ("x", "y")
XYZ_COLUMNS = tuple(f"{channel}_{axis}" for channel in ("red", "green", "blue") for axis in "xyz")
SHOT_COLUMNS = ("focal_mm", "aperture", "d65_r", "d65_b")
OPTIONAL_COLUMNS = (
    *WB_COLUMNS, *POSITION_COLUMNS, *SHOT_COLUMNS, *XYZ_COLUMNS, "raw_camera", "lens", "raw_space", "developer",
)  # fmt: skip
NUMBER_COLUMNS = (
    "exposure_s", *RAW_COLUMNS, *SRGB_COLUMNS, *WB_COLUMNS, *POSITION_COLUMNS, *SHOT_COLUMNS, *XYZ_COLUMNS,
)  # fmt: skip
COLUMNS_OF = {
    "raw": RAW_COLUMNS, "srgb": SRGB_COLUMNS, "wb": WB_COLUMNS, "position": POSITION_COLUMNS, "from_xyz": XYZ_COLUMNS,
}  # fmt: skip
"""The columns of a table that one array of a SampleSet holds; the others are arrays of their own."""

ROUNDING = 1e-6
"""How far a colour may lie outside its range through rounding; it is set to the end of the range."""
RAW_RANGE = (-0.05, 1.0)
"""RAW after black subtraction: noise of dark surfaces falls a little below 0 and is kept."""
MULTIPLIER_RANGE = (1e-3, 1e3)
"""White-balance multipliers relative to green that any camera could have."""
MAX_ROWS = 50_000_000
MAX_TEXT = 200
"""Characters in a cell."""


def wanted_columns(path: Path, names: list[str]) -> list[str]:
    """The known columns among these. Raises SampleError on missing, doubled or too many columns."""
    if len(names) > 1000:
        raise SampleError(f"{path}: {len(names)} columns; a sample table has at most 1000")
    doubled = sorted({name for name in names if name and names.count(name) > 1})
    if doubled:
        raise SampleError(f"{path}: column {doubled[0]!r} occurs twice; keep one of them")
    missing = [name for name in REQUIRED_COLUMNS if name not in names]
    for group in (WB_COLUMNS, POSITION_COLUMNS):
        if any(name in names for name in group):
            missing += [name for name in group if name not in names]
    if missing:
        raise SampleError(
            f"{path}: missing column{'s' * (len(missing) > 1)} {', '.join(missing)};"
            " the first line of a sample table names its columns"
        )
    return [name for name in names if name in REQUIRED_COLUMNS or name in OPTIONAL_COLUMNS]


def problem_in(
    columns: Mapping[str, NDArray[Any]], shown: Callable[[str, int], str] | None = None
) -> tuple[int, str] | None:
    """The first row of columns (n,) that no table may hold, and what is wrong with it; None where all may be.

    shown: column and row → the cell as it is written, without which it is the number.
    """
    cell = shown or (lambda name, row: f"{columns[name][row]:.10g}" if name in NUMBER_COLUMNS else "")
    problems: list[tuple[int, str]] = []
    for name, values in columns.items():
        if name in NUMBER_COLUMNS:
            low, high = _limits(name)
            may_be_unknown = name == "exposure_s" or name in OPTIONAL_COLUMNS
            wrong = ~((values >= low) & (values <= high) | np.isnan(values) & may_be_unknown)
        else:
            wrong = (values == "") & (name in TEXT_COLUMNS and name != "patch")
        if wrong.any():
            row = int(np.argmax(wrong))
            problems.append((row, _cell_problem(name, cell(name, row))))
    if "wb_g" in columns:
        wb = np.stack([columns[name] for name in WB_COLUMNS], axis=1)
        with np.errstate(all="ignore"):
            ratio = wb / wb[:, 1:2]
        plausible = (ratio >= MULTIPLIER_RANGE[0]) & (ratio <= MULTIPLIER_RANGE[1])
        wrong = ~(np.isnan(wb).all(axis=1) | plausible.all(axis=1))
        if wrong.any():
            row = int(np.argmax(wrong))
            partly = "give all three, or leave all three empty"
            what = partly if np.isnan(wb[row]).any() else "no camera has such multipliers"
            problems.append((row, f"wb_r,wb_g,wb_b is {','.join(cell(name, row) for name in WB_COLUMNS)!r}; {what}"))
    return min(problems, key=lambda problem: problem[0], default=None)


def _limits(name: str) -> tuple[float, float]:
    if name in RAW_COLUMNS:
        return RAW_RANGE[0] - ROUNDING, RAW_RANGE[1] + ROUNDING
    if name in SRGB_COLUMNS:
        return -ROUNDING, 1 + ROUNDING
    if name in POSITION_COLUMNS:
        return -1.0, 1.0
    return math.ulp(0.0), math.nextafter(math.inf, 0.0)


def _cell_problem(name: str, cell: str) -> str:
    """What is wrong with a cell that is none of its column's, in words."""
    if not cell:
        wanted = "a number" if name in NUMBER_COLUMNS else f"the {name.replace('_', ' ')} of the sample"
        return f"{name} is empty; write {wanted}"
    shown = f"{name} is {cell[:40]}"
    if not math.isfinite(float(cell)):
        return f"{shown}; write a finite number"
    if name in RAW_COLUMNS:
        return f"{shown}; RAW lies in [0, 1]: subtract the black level and divide by (white - black)"
    if name in SRGB_COLUMNS:
        return f"{shown}; sRGB lies in [0, 1]: divide 8-bit JPEG values by 255"
    if name in POSITION_COLUMNS:
        return f"{shown}; positions lie in [-1, 1]: half the picture's diagonal is 1"
    meaning = {"exposure_s": "exposure time in seconds", "focal_mm": "focal length in mm", "aperture": "f-number"}
    return f"{shown}; the {meaning.get(name, 'multiplier')} is positive, or the cell empty where it is unknown"


Text = NDArray[np.str_]


@dataclass(frozen=True, eq=False)
class SampleSet:
    """One sample a row: text columns (n,) numpy strings, `exposure_s` (n,), colours (n, 3) float64.

    raw: linear camera RGB before white balance, 0 = black level, 1 = saturation. srgb: the JPEG value / 255.
    wb: the white-balance multipliers with green = 1; NaN where unknown. exposure_s: NaN where unknown.
    raw_camera: the camera that the RAW is of; equal to `camera` unless a reference camera's RAW stands in.
    position: (n, 2) x to the right and y down from the centre of the RAW's visible area, half its diagonal = 1; NaN
    where unknown. lens: its name, "" where unknown. focal_mm, aperture (f-number): (n,), NaN where unknown. d65_r,
    d65_b: (n,), what neutralizes light D65 on this camera as its maker or LibRaw has it, green = 1; NaN where unknown.
    from_xyz: (n, 9), the rows of the matrix XYZ → RAW of any scale that LibRaw or a DNG file has; NaN where unknown.
    raw_space, developer: where a program's pictures stand in the place of the RAW, the RGB space in which these were
    encoded, and the program; "" for RAW. The columns from `position` on may be left out; they are unknown then.
    `from_arrays` fills in more. Raises SampleError where the columns differ in length.
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

    def __post_init__(self) -> None:
        count = len(self.camera)
        for name in (
            "position",
            "lens",
            "focal_mm",
            "aperture",
            "d65_r",
            "d65_b",
            "from_xyz",
            "raw_space",
            "developer",
        ):
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
        """Make samples of arrays; what is given once (a text, a number, one wb triple) stands for every sample.

        raw, srgb: (n, 3); wb: (3,) or (n, 3); the others a value or (n,); each as the class describes it.
        Raises SampleError where a column does not fit the number of samples, and on the first that no table may hold.
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
        made = cls(
            **words,
            raw=linear,
            srgb=encoded,
            exposure_s=column("exposure_s", exposure_s),
            wb=column("wb", wb, 3),
            raw_camera=words["camera"],
        )
        columns = {name: getattr(made, group)[:, i] for group in COLUMNS_OF for i, name in enumerate(COLUMNS_OF[group])}
        if (problem := problem_in({"exposure_s": made.exposure_s, **columns})) is not None:
            raise SampleError(f"samples: row {problem[0]}: {problem[1]}")
        return made

    def __repr__(self) -> str:
        cameras = ", ".join(np.unique(self.camera))
        return f"SampleSet({cameras}: samples {len(self)}, shots {len(np.unique(self.shot))})"

    def __len__(self) -> int:
        return len(self.camera)

    def save(self, path: str | Path) -> None:
        """Write the samples to a table (.csv or .npz), atomically; `lutforge.read_samples` reads it."""
        from lutforge.samples.table import write_samples

        write_samples(path, self)

    @property
    def settings(self) -> Text:
        """White balances (n,), where "auto" is one of each shot: the camera may change it from shot to shot."""
        return np.where(self.white_balance == "auto", np.char.add("auto of ", self.shot), self.white_balance)

    @property
    def is_own_raw(self) -> bool:
        """True where nothing stands in the place of the camera's own RAW."""
        return bool(np.all(self.raw_camera == self.camera) and np.all(self.developer == ""))

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


def unclipped_colours(encoded: Array, raw: Array) -> Mask:
    """Mask (n,) of colours encoded (n, 3) half a code inside 0 … 1, of raw (n, 3) neither black nor saturated."""
    half_code = 0.5 / 255.0
    inside = (encoded >= half_code) & (encoded <= 1.0 - half_code) & (raw > 0.0) & (raw < 0.999)
    return np.asarray(np.all(inside, axis=1))
