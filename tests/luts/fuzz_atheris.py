"""LUT files made by libFuzzer, guided by the coverage of the readers, through `check_lut`.

    pip install '.[fuzz]'
    python -m tests.luts.fuzz_atheris 30000        # the number of files; further words go to libFuzzer

The first byte picks the kind of file. A traceback, more than 2 s for a file, or more than 1 GB ends the run, and keeps
the file.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import atheris

COMPILED = ["lutforge.luts.formats.text"]
"""Modules with loops that numba compiles; they cannot be instrumented."""

with atheris.instrument_imports(include=["lutforge.luts"], exclude=COMPILED):
    from tests.cases.damaged import LUTS, READERS, fault, whole_files

LONGEST = 30_000


def main() -> None:
    count = sys.argv[1] if len(sys.argv) > 1 else "30000"
    with TemporaryDirectory() as name:
        folder, corpus = Path(name), Path(name) / "corpus"
        corpus.mkdir()
        (folder / "seeds").mkdir()
        whole = whole_files(folder / "seeds")
        for number, kind in enumerate(LUTS):
            (corpus / f"a{kind}").write_bytes(bytes([number]) + whole[kind])

        def one_file(data: bytes) -> None:
            kind = LUTS[data[0] % len(LUTS) if data else 0]
            path = folder / f"x{kind}"
            path.write_bytes(data[1:])
            if problem := fault(path, READERS[kind]):
                raise AssertionError(problem)

        flags = [f"-runs={count}", "-timeout=2", "-rss_limit_mb=1024", f"-max_len={LONGEST}", "-seed=1"]
        atheris.Setup([sys.argv[0], str(corpus), *flags, *sys.argv[2:]], one_file)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
