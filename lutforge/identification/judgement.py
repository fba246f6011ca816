"""Probabilities of cameras, styles and white balances, with the chance that none of them rendered the picture."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from lutforge.arrays import Array
from lutforge.errors import ProfileError
from lutforge.identification.evidence import Explained, PictureEvidence, explain
from lutforge.identification.noise_tally import TO_YCC
from lutforge.identification.rendering import Rendering
from lutforge.solvers.blas import one_blas_thread


@dataclass(frozen=True)
class JudgementOptions:
    """Weights of the evidence, measured on simulated cameras (`tests/benchmarks/identify.py --calibrate`).

    noise, scene, reach: factors of the three log-likelihoods. Larger ones, above all for the scene, make the truth more
    probable on simulated cameras, whose scenes the density was learned from, but less probable on real ones.

    balance: the factor of the noise's log-likelihood where white balances of one style are compared. It is larger than
    `noise`, because errors of the calibration affect this comparison less.

    strangers: the log prior, relative to a profile, of a rendering that stands for cameras without a profile. With it
    nine in ten pictures by such cameras get no answer.

    sure: the probability from which an answer is given. alike: white balances whose multipliers differ by less than
    this are one answer.
    """

    noise: float = 0.04
    scene: float = 1.8
    reach: float = 6.0
    balance: float = 0.2
    strangers: float = -2.0
    sure: float = 0.5
    alike: float = 0.02


DEPARTURES: tuple[Mapping[str, float], ...] = tuple(
    {name: sign * size}
    for name, size in (("gamma", 0.15), ("contrast", 0.25), ("saturation", 0.15))
    for sign in (1, -1)
)
"""Changes of tone and saturation that make the likeliest rendering stand for other cameras, by about as much as styles
of one camera differ."""


@dataclass(frozen=True)
class Candidate:
    """One answer. white_balances: probability by name, given the camera and style."""

    camera: str
    style: str
    probability: float
    white_balances: Mapping[str, float]


@dataclass(frozen=True)
class Judgement:
    """Candidates, the likeliest first; unknown: the probability that none of them rendered the picture.

    answer: the camera and style, None where that cannot be told; white_balance: likewise, () where it cannot be told,
    else the names whose multipliers are alike. notes: what evidence is missing.
    """

    candidates: tuple[Candidate, ...]
    unknown: float
    answer: Candidate | None
    white_balance: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def lines(self) -> tuple[str, ...]:
        """The judgement in words: the answer first, then what it rests on."""
        best = self.candidates[0]
        named = f"{best.camera}, style {best.style}"
        if self.answer is None:
            first = f"cannot tell (nearest: {named}, {best.probability:.0%}; none of these: {self.unknown:.0%})"
        else:
            first = f"{named} ({best.probability:.0%})"
        balances = sorted(best.white_balances.items(), key=lambda each: -each[1])
        told = ", ".join(f"{name} {share:.0%}" for name, share in balances if share >= 0.02)
        certain = " or ".join(self.white_balance) if self.white_balance else "cannot tell"
        shares = "" if self.answer is None else f" ({told})"  # they hold where the camera is the one that is named
        return (first, f"white balance: {certain}{shares}", *self.notes)

    def as_json(self) -> dict[str, object]:
        """Return the judgement as plain values, for JSON."""
        return {
            "camera": None if self.answer is None else self.answer.camera,
            "style": None if self.answer is None else self.answer.style,
            "white_balance": list(self.white_balance),
            "none_of_these": round(self.unknown, 4),
            "candidates": [
                {
                    "camera": each.camera,
                    "style": each.style,
                    "probability": round(each.probability, 4),
                    "white_balances": {name: round(share, 4) for name, share in each.white_balances.items()},
                }
                for each in self.candidates
            ],
            "notes": list(self.notes),
        }


@one_blas_thread
def judge(picture: PictureEvidence, known: Sequence[Rendering], options: JudgementOptions | None = None) -> Judgement:
    """Weigh the renderings. Raises ProfileError where there is none."""
    if not known:
        raise ProfileError("no profile to compare the picture with")
    options = JudgementOptions() if options is None else options
    explained = [explain(picture, rendering) for rendering in known]
    cameras = [rendering.camera for rendering in known]
    # Cameras are as likely as each other, and so are the styles of each.
    likely = [
        _log_likelihoods(each, options) - np.log(cameras.count(camera))
        for each, camera in zip(explained, cameras, strict=True)
    ]
    near = known[int(np.argmax([each.max() for each in likely]))]
    strangers = [
        _log_likelihoods(explain(picture, departed(near, **each)), options) - np.log(cameras.count(near.camera))
        for each in DEPARTURES
    ]
    shares = _shares(likely, strangers, options)
    candidates = [
        Candidate(rendering.camera, rendering.style, share, _white_balances(rendering, each, options))
        for rendering, each, share in zip(known, explained, shares[:-1].tolist(), strict=True)
    ]
    best = int(np.argmax(shares[:-1]))
    answer = candidates[best] if candidates[best].probability >= options.sure else None
    notes = () if picture.noise else ("no JPEG with noise of its own: judged by its colours alone, which tell little",)
    told = () if answer is None else _alike(answer.white_balances, known[best].white_balances, options)
    ranked = tuple(sorted(candidates, key=lambda candidate: -candidate.probability))
    return Judgement(ranked, float(shares[-1]), answer, told, notes)


def _log_likelihoods(explained: Explained, options: JudgementOptions) -> Array:
    """Return the weighted log-likelihoods (w,) of a rendering with each of its white balances.

    All white balances have the same prior probability.
    """
    colours = options.scene * explained.scene + options.reach * explained.reach
    return np.asarray(options.noise * explained.noise + colours + explained.encoder - np.log(len(explained.noise)))


def _shares(likely: Sequence[Array], strangers: Sequence[Array], options: JudgementOptions) -> Array:
    """The probability of each rendering, and at the end that of none of them."""
    known = [float(scipy.special.logsumexp(each)) for each in likely]
    other = float(scipy.special.logsumexp(np.concatenate(strangers))) + options.strangers
    return np.asarray(scipy.special.softmax([*known, other]))


def _white_balances(rendering: Rendering, explained: Explained, options: JudgementOptions) -> dict[str, float]:
    """The probability of each white balance of a rendering, by name."""
    shares = scipy.special.softmax(options.balance * explained.noise).tolist()
    return dict(zip(rendering.white_balances, shares, strict=True))


def _alike(shares: Mapping[str, float], multipliers: Mapping[str, Array], options: JudgementOptions) -> tuple[str, ...]:
    """The likeliest white balance with those like it, where they are likely enough together."""
    best = max(shares, key=lambda name: shares[name])
    names = tuple(
        name for name in shares if np.all(np.abs(multipliers[name] / multipliers[best] - 1.0) <= options.alike)
    )
    return names if sum(shares[name] for name in names) >= options.sure else ()


def departed(rendering: Rendering, gamma: float = 0.0, contrast: float = 0.0, saturation: float = 0.0) -> Rendering:
    """A rendering near another one, whose codes v are first v + gamma v (1 − v) + contrast v (1 − v) (1 − 2 v).

    saturation: what chroma is multiplied by beyond 1, about luma.
    """
    codes = np.linspace(0.0, 1.0, 1025)
    bent = codes + codes * (1.0 - codes) * (gamma + contrast * (1.0 - 2.0 * codes))

    def scaled(colours: Array, factor: float) -> Array:
        luma = (colours @ TO_YCC[0])[..., None]
        return np.asarray(np.clip(luma + factor * (colours - luma), 0.0, 1.0))

    def linearize(encoded: Array) -> Array:
        return rendering.linearize(scaled(np.interp(encoded, codes, bent), 1.0 + saturation))

    def render(scene: Array) -> Array:
        return np.interp(scaled(rendering.render(scene), 1.0 / (1.0 + saturation)), bent, codes)

    return replace(rendering, linearize=linearize, render=render, encoders=())
