"""Work on all cores: parts of kernels, and tasks at the same time."""

from threading import Event, get_ident

import pytest

from lutforge import threads


def test_tasks_keep_their_parts_to_themselves_but_the_last_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "cores", lambda: 2)
    first_is_done, others = Event(), {}

    def task(name: str) -> str:
        if name == "last":
            assert first_is_done.wait(120)
        ran_by: list[int] = []
        threads.run(lambda start, stop: ran_by.append(get_ident()), [(0, 1), (1, 2)])
        others[name] = [thread for thread in ran_by if thread != get_ident()]
        return name

    for name in threads.each(task, ["first", "last"]):
        if name == "first":
            first_is_done.set()
    assert not others["first"]
    assert len(others["last"]) == 2
