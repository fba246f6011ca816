"""The command lines that LutForge prints, run as they stand in the programs, on films and pictures of known colours."""

import json
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.colour.srgb import delta_e_2000
from lutforge.images.read import read_image
from lutforge.luts import command_lines
from lutforge.luts.lut_programs import PROGRAMS
from lutforge.pipeline.baking import bake
from tests.cases.pictures import write_picture

GUIDE = Path(__file__).parents[2] / "examples" / "guide"
WIDTH, HEIGHT, SIDE = 1280, 720, 40
"""The smallest frame of HD film, and the side of its patches in pixels: subsampled colour is even within them."""

LUMA = np.array([0.2126, 0.7152, 0.0722])
"""The weights of BT.709."""


def look(x: ArrayLike) -> Array:
    """A look with a toe, a shoulder and crossed channels; [0, 1]³ → [0, 1]³."""
    mixed = np.asarray(x, dtype=np.float64) ** 2.2 @ np.array(
        [[1.25, -0.12, -0.02], [-0.15, 1.2, -0.2], [-0.1, -0.08, 1.22]]
    )
    mapped = np.clip(mixed, 0.0, None)
    return np.asarray(np.clip(1.18 * mapped / (mapped + 0.18), 0.0, 1.0) ** (1 / 1.6))


def patches() -> Array:
    """Colours of the patches of a frame (18, 32, 3): greys in the first row, then random ones."""
    colours = np.random.default_rng(3).random((HEIGHT // SIDE, WIDTH // SIDE, 3))
    colours[0] = np.linspace(0.0, 1.0, WIDTH // SIDE)[:, None]
    return colours


def to_codes(rgb: Array, bits: int, full: bool) -> Array:
    """RGB (…, 3) → whole Y'CbCr codes of BT.709, in video range or in full range."""
    luma = rgb @ LUMA
    chroma = np.stack([(rgb[..., 2] - luma) / 1.8556, (rgb[..., 0] - luma) / 1.5748], axis=-1)
    step = 2 ** (bits - 8)
    scales = (2**bits - 1, 0.0, 2**bits - 1) if full else (219 * step, 16 * step, 224 * step)
    codes = np.concatenate([(luma * scales[0] + scales[1])[..., None], chroma * scales[2] + 128 * step], axis=-1)
    return np.asarray(np.clip(np.rint(codes), 0, 2**bits - 1), dtype=np.float64)


def from_codes(codes: Array, bits: int, full: bool) -> Array:
    """Codes (…, 3) → RGB: the inverse of `to_codes`."""
    step = 2 ** (bits - 8)
    scales = (2**bits - 1, 0.0, 2**bits - 1) if full else (219 * step, 16 * step, 224 * step)
    luma, chroma = (codes[..., 0] - scales[1]) / scales[0], (codes[..., 1:] - 128 * step) / scales[2]
    red, blue = luma + 1.5748 * chroma[..., 1], luma + 1.8556 * chroma[..., 0]
    return np.stack([red, (luma - LUMA[0] * red - LUMA[2] * blue) / LUMA[1], blue], axis=-1)


def write_film(path: Path, bits: int, full: bool = False) -> Array:
    """Write a film of two frames, 4:2:0, and return the colours of its patches as they are coded."""
    codes = to_codes(patches(), bits, full)
    frame = np.repeat(np.repeat(codes, SIDE, axis=0), SIDE, axis=1).astype(np.uint8 if bits == 8 else np.uint16)
    planes = frame[..., 0].tobytes() + frame[::2, ::2, 1].tobytes() + frame[::2, ::2, 2].tobytes()
    tags = [
        *("-color_range", "pc" if full else "tv", "-colorspace", "bt709"),
        *("-color_primaries", "bt709", "-color_trc", "bt709"),
    ]
    layout = "yuv420p" if bits == 8 else "yuv420p10le"
    command = ["ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", layout, "-s", f"{WIDTH}x{HEIGHT}", *tags]
    command += ["-i", "-", "-c:v", "ffv1", *tags, "-f", "matroska", str(path)]
    subprocess.run(command, input=2 * planes, check=True)
    return np.clip(from_codes(codes, bits, full), 0.0, 1.0)


def shown(path: Path, bits: int = 8) -> Array:
    """The colours of the patches of a film as a player shows them, by its tags; untagged HD film is BT.709."""
    layout = "yuv420p" if bits == 8 else "yuv420p10le"
    probe = ["ffprobe", "-v", "error", "-select_streams", "v", "-show_streams", "-of", "json", str(path)]
    stream = json.loads(subprocess.run(probe, check=True, capture_output=True).stdout)["streams"][0]
    assert stream.get("color_space", "bt709") == "bt709"
    assert (stream["width"], stream["height"], stream["pix_fmt"]) == (WIDTH, HEIGHT, layout)
    read = ["ffmpeg", "-v", "error", "-i", str(path), "-frames:v", "1", "-f", "rawvideo", "-pix_fmt", layout, "-"]
    frame = subprocess.run(read, check=True, capture_output=True).stdout
    data = np.frombuffer(frame, np.uint8 if bits == 8 else np.uint16).astype(np.float64)
    luma, blue, red = np.split(data, [WIDTH * HEIGHT, WIDTH * HEIGHT * 5 // 4])
    planes = [luma.reshape(HEIGHT, WIDTH), *(plane.reshape(HEIGHT // 2, WIDTH // 2) for plane in (blue, red))]
    middle = [
        plane[height // 2 :: height, height // 2 :: height] for plane, height in zip(planes, (40, 20, 20), strict=True)
    ]
    return np.clip(from_codes(np.stack(middle, axis=-1), bits, stream.get("color_range") == "pc"), 0.0, 1.0)


@cache
def baked(program: str) -> bytes:
    """The cube of the look as `bake` writes it for a program."""
    with TemporaryDirectory() as folder:
        lut = Path(folder, "look.cube")
        bake(look, lut, program=program)
        return lut.read_bytes()


def need(program: str) -> None:
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")


def run(line: str, folder: Path) -> None:
    done = subprocess.run(["/bin/sh", "-ec", line], cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, f"{line}\n{done.stdout[-300:]}{done.stderr[-800:]}"


LINES = {"ffmpeg": command_lines.ffmpeg, "mlt": command_lines.melt}

# H.264 and H.265 of the highest quality: what a line leaves to the encoder is not measured.
QUALITY = {"ffmpeg": ("-c:a copy", "-crf 1"), "mlt": ("mlt_image_format", "crf=1 an=1 mlt_image_format")}


@pytest.mark.parametrize(
    ("bits", "full", "within"),
    [(8, False, 0.7), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((10, False, 0.25), (8, True, 0.7)))],
)
@pytest.mark.parametrize("program", ["ffmpeg", pytest.param("mlt", marks=pytest.mark.slow)])
def test_a_film_is_graded_as_the_cube_says(program: str, bits: int, full: bool, within: float, tmp_path: Path) -> None:
    """A film of 8 bits to 8 bits, and one of 10 bits to 10 bits."""
    need("melt" if program == "mlt" else program)
    x = write_film(tmp_path / "IN.mov", bits, full)
    lut = tmp_path / "It's [my], look: 50%; v1.cube" if program == "ffmpeg" else tmp_path / "my look.cube"
    lut.write_bytes(baked(program))
    assert PROGRAMS[program].advice(lut) == LINES[program](lut)
    run(LINES[program](lut, bits).replace(*QUALITY[program]), tmp_path)
    error = delta_e_2000(shown(tmp_path / "OUT.mov", bits), look(x))
    assert error.mean() < within
    assert error.max() < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("bits", [8, 10])
def test_a_film_is_shown_as_the_cube_says(bits: int, tmp_path: Path) -> None:
    need("mpv")
    x = write_film(tmp_path / "IN.mov", bits)
    (tmp_path / "look.cube").write_bytes(baked("mpv"))
    line = PROGRAMS["mpv"].advice(Path("look.cube"))
    run(f"{line} --no-config --vo=image --vo-image-format=png --frames=1", tmp_path)
    (frame,) = tmp_path.glob("*.png")
    seen = read_image(frame).pixels[SIDE // 2 :: SIDE, SIDE // 2 :: SIDE, :3]
    assert delta_e_2000(seen.astype(np.float64), look(x)).mean() < 0.25


@pytest.mark.slow
@pytest.mark.parametrize("bits", [8, 16])
def test_a_picture_is_graded_as_the_cube_says(bits: int, tmp_path: Path) -> None:
    top = 2**bits - 1
    picture = (np.rint(patches() * top) / top).astype(np.float32)
    lut = tmp_path / "my look.cube"
    lut.write_bytes(baked("gmic"))
    lines = {"gmic": command_lines.gmic(lut, bits)}
    lines["ffmpeg"] = f'ffmpeg -v error -y -i IN.png -vf "{command_lines.ffmpeg_cube("my look.cube")}" OUT.png'
    for program, line in lines.items():
        need(program)
        write_picture(tmp_path / "IN.png", kind=f"uint{bits}", pixels=picture)
        run(line, tmp_path)
        seen = read_image(tmp_path / "OUT.png").pixels[..., :3].astype(np.float64)
        assert delta_e_2000(seen, look(picture)).mean() < 0.3
        grey = np.abs(seen - look(picture))[0].mean()
        assert grey < 1.0 / 255  # the scale of the nodes is right
        (tmp_path / "OUT.png").unlink()


def test_the_guide_has_the_same_lines() -> None:
    """Every line of the guide that puts a cube on a film is the one of the code, with its own names of files."""
    makers = {"ffmpeg": command_lines.ffmpeg, "melt": command_lines.melt}
    pages = [page.read_text(encoding="utf-8") for page in sorted(GUIDE.glob("*.md"))]
    lines = [
        line for page in pages for line in re.findall(r"^ {4}((?:ffmpeg|mpv|melt) .*lut3d.*)$", page, re.MULTILINE)
    ]
    films = [line for line in lines if ".png" not in line]
    written = set()
    for line in films:
        first, *more = re.findall(r"file=([^:]+?\.cube)", line)
        program, bits = line.split()[0], 10 if "yuv420p10" in line else 8
        expected = command_lines.mpv(first) if program == "mpv" else makers[program](first, bits)
        for second in more:
            whole = ":interp=tetrahedral"
            expected = expected.replace(whole, f"{whole},lut3d=file={second}{whole}")
        assert re.sub(r"\w+\.mov", "FILM.mov", line) == re.sub(r"\w+\.mov", "FILM.mov", expected)
        written.add((program, bits))
    assert written == {("ffmpeg", 8), ("ffmpeg", 10), ("mpv", 8), ("melt", 8), ("melt", 10)}
    cubes = [line for page in pages for line in re.findall(r"^ {4}gmic .*", page, re.MULTILINE)]
    lookups = [command_lines.gmic("a.cube", bits).split(" fill")[1].split(" output")[0] for bits in (8, 16)]
    assert sorted(line.split(" fill")[1].split(" output")[0] for line in cubes) == sorted(lookups)
