"""LUT files spoilt at random, through `check_lut`: each gives a report or one clear line, soon and in little memory.

python -m tests.luts.fuzz_luts 30000        # the number of files
"""

import resource
import sys
import time
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.check import check_lut, report_lines
from lutforge.luts.ops import Cube
from lutforge.luts.sequence import Lut
from lutforge.model.lattice import grid, uniform_levels
from tests.cases.luts import lut_of_nodes

TOKENS = (
    *(b"-1", b"0", b"nan", b"inf", b"1e999", b"1e308", b"99999999999", b"4294967296", b"129", b"1048576", b"\xff\xfe"),
    *(b"\x00", b"\r", b"\n", b"{", b"}", b"<", b"&lol;", b'"', b"LUT_3D_SIZE 256\n", b"LUT_1D_SIZE 1048576\n", b"#"),
    *(
        b"TITLE",
        b"DOMAIN_MAX 0 0 0\n",
        b"END METADATA\n",
        b"3D\n",
        b"Length 1000000\n",
        b"<!DOCTYPE x>",
        b"\xef\xbb\xbf",
    ),
    *(b"halfDomain='true'", b"dim='256 256 256 3'", b"<Array dim='2 2 2 3'>", b"_", b"1_0", "٣".encode(), b"0x10"),
)


def seeds(folder: Path) -> dict[str, bytes]:
    """A small valid file of every format: name → bytes."""
    levels = (np.array([0.0, 0.125, 1.0]),) * 3
    lut = lut_of_nodes(levels, grid(uniform_levels(3)) ** 0.5, size=9, comments=("a comment",))
    plain = Lut((Cube(grid(uniform_levels(4)) ** 0.5),), title="title")
    found = {}
    for name in ("a.clf", "a.ctf", "a.resolve.cube", "a.csp", "a.spi3d", "a.dctl"):
        lut.write(folder / name)
    for name in ("b.cube", "b.clf", "b.png", "b.tif"):
        plain.write(folder / name)
    for name in ("c.3dl", "c.vlt"):
        Lut((Cube(grid(uniform_levels(17))),)).write(folder / name)
    (folder / "d.cube").write_text("LUT_1D_SIZE 3\n0 0 0\n.5 .5 .5\n1 1 1\n")
    for path in folder.iterdir():
        found[path.name] = path.read_bytes()
    return found


def spoil(data: bytes, random: Random) -> bytes:
    """One random change, or up to six: bytes flipped, cut, doubled, moved, or replaced by something nasty."""
    spoilt = bytearray(data)
    for _ in range(random.choice((1, 1, 1, 2, 3, 6))):
        if not spoilt:
            break
        at = min(int(random.random() ** 2 * len(spoilt)), len(spoilt) - 1)  # headers are where it hurts
        span = random.randint(1, 40)
        match random.randrange(8):
            case 0:
                spoilt[at] = random.randrange(256)
            case 1:
                spoilt[at] = random.choice(b"0123456789. ")
            case 2:
                del spoilt[at : at + span]
            case 3:
                spoilt[at:at] = spoilt[at : at + span]
            case 4:
                spoilt[at:at] = random.choice(TOKENS)
            case 5:
                spoilt[at : at + random.randint(1, 8)] = random.choice(TOKENS)
            case 6:
                del spoilt[at:]
            case _:
                other = random.randrange(len(spoilt))
                spoilt[at : at + span] = spoilt[other : other + span]
    return bytes(spoilt)


def try_file(path: Path) -> str:
    """Return "report" or the error's line. Whatever else is raised is a bug."""
    try:
        lines = report_lines(check_lut(path))
    except LutError as error:
        message = str(error)
        assert len(message) <= 500, message
        assert message.isprintable(), message
        return message
    assert all("\n" not in line for line in lines)
    return "report"


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 30000
    random = Random(int(sys.argv[2]) if len(sys.argv) > 2 else 1)
    slowest, reports, begin = 0.0, 0, time.perf_counter()
    with TemporaryDirectory() as name:
        folder = Path(name)
        originals = sorted(seeds(folder).items())
        for number in range(count):
            file, data = originals[number % len(originals)]
            path = folder / f"x{Path(file).suffix}"
            path.write_bytes(spoilt := spoil(data, random))
            start = time.perf_counter()
            try:
                reports += try_file(path) == "report"
            except Exception:
                kept = Path(f"crash-{number}{path.suffix}")
                kept.write_bytes(spoilt)
                print(f"file {number}, kept as {kept}")
                raise
            slowest = max(slowest, time.perf_counter() - start)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(
        f"{count} files: {reports} reports, {count - reports} errors; slowest {slowest:.2f} s, "
        f"memory {memory:.2f} GB, {time.perf_counter() - begin:.0f} s"
    )


if __name__ == "__main__":
    main()
