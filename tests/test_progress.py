"""Progress tells where work is, and when kernels compile."""

from typing import Any

import numba

from lutforge.progress import part, telling_of_compilation


def test_a_part_takes_its_share_of_the_whole() -> None:
    told: list[tuple[str, float]] = []
    within = part(lambda what, share: told.append((what, share)), 0.5, 1.0, "vivid")
    within("fitting", 0.5)
    assert told == [("vivid: fitting", 0.75)]


def test_compiling_a_kernel_is_told_once() -> None:
    told: list[tuple[str, float]] = []

    doubled: Any = numba.njit(lambda value: 2 * value)

    with telling_of_compilation(lambda what, share: told.append((what, share))) as progress:
        progress("fitting", 0.25)
        doubled(1.0)
        doubled(2.0)
    assert [what for what, _ in told] == ["fitting", told[1][0], "fitting"]
    assert "compiling" in told[1][0]
    assert {share for _, share in told} == {0.25}
