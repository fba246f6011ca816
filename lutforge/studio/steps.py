"""The five steps: whether each is done, to do or stale, and what to do next there."""

from typing import Literal

from lutforge.studio.session import Session

State = Literal["to do", "done", "stale"]
STEPS = ("Shots", "Samples", "Model", "Look", "Export")


def states_of(session: Session) -> dict[str, tuple[State, str]]:
    """Each step's state, and in a sentence what to do next there."""
    open_, bracket = session.history is not None, session.opened.bracket
    stale = session.is_stale
    model: State = "stale" if stale else "done" if session.has_profile else "to do"
    chosen: State = "to do" if not session.look_chosen or model == "to do" else "stale" if stale else "done"
    old = any(map(session.is_old, session.written.values()))
    export: State = "to do" if not session.written else "stale" if old else "done"
    shots: State = "done" if open_ or session.has_profile else "to do"
    telling = {
        "Shots": {
            "to do": (
                "Drop RAW files with their JPEGs here, or choose a folder; then press Sample."
                if bracket is None else "Name the chart, if the pictures show one, and press Fit response."
            ),
            "done": (
                "Click a shot to leave it out or take it back in; then look at the samples." if bracket is None
                else "Click a picture to leave it out, and fit again; or go on to Export."
            ),
        }[shots],
        "Samples": (
            "Keep saturated and clipped colours from the response by the filters, or mark samples with the lasso."
            if open_ else "A bracket has no samples to choose from: go on to the look, or to Export."
            if bracket else "Open shots or a sample table first."
        ),
        "Model": {
            "to do": "Press Compute: the lattice is what most want; or fit stage by stage.",
            "done": "The model is up to date: see its errors here, then choose a look.",
            "stale": "Samples or options have changed since: press Compute.",
        }[model],
        "Look": {
            "to do": "Choose a photograph and the style and white balance that you want.",
            "done": (
                "The look is what the exports hold." if session.look.source
                else "A kit is made for this look; a picture needs “Taken as”, too: choose what it was taken as."
            ),
            "stale": "The model is not up to date: compute it again under Model.",
        }[chosen],
        "Export": {
            "to do": (
                "Name the files, and write what your program needs: a kit, a LUT, a config." if session.has_profile
                else "Compute a model under Model first, or open a profile under Shots."
            ),
            "done": "Written as below; each line can be run again as a command.",
            "stale": "Model or look have changed since: write again what you need.",
        }[export],
    }  # fmt: skip
    states: dict[str, State] = {
        "Shots": shots, "Samples": "done" if open_ else "to do", "Model": model, "Look": chosen, "Export": export,
    }  # fmt: skip
    return {step: (states[step], telling[step]) for step in STEPS}
