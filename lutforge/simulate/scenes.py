"""The scenes that the demo photographs: a colour chart, a wall of paint cards, a still life."""

from collections.abc import Callable, Mapping

import numpy as np

from lutforge.simulate.scene import Scene, palette, smooth_noise

WHITE_PATCH, GREY_PATCH = 18, 21
"""Places of two of the chart's neutral patches in a palette."""


def chart_scene(height: int = 800, width: int = 1200, seed: int = 0) -> Scene:
    """A ColorChecker Classic, a little tilted, on a grey studio background under one soft light."""
    rng = np.random.default_rng([seed, 1])
    scene = Scene.blank(height, width, palette(0, rng))
    texture = 1 + 0.012 * smooth_noise((height, width), 3, rng)
    light = 1.05 - 0.12 * scene.x / (width / height) - 0.06 * scene.y
    scene.paint(scene.y > 0, GREY_PATCH, shade=light * texture)
    x, y = width / height / 2 + rng.uniform(-0.03, 0.03), 0.5 + rng.uniform(-0.02, 0.02)
    scene.soft_shadow(x + 0.03, y + 0.04, 0.62, 0.42, 0.25)
    scene.chart(x, y, 1.02, rng.uniform(-0.04, 0.04), light)
    return scene.vignetted()


def paint_wall(height: int = 800, width: int = 1200, seed: int = 0) -> Scene:
    """Rows of paint cards in many colours, from pale to deep, a part of the wall in a soft shadow."""
    rng = np.random.default_rng([seed, 2])
    count = 104
    scene = Scene.blank(height, width, palette(count, rng))
    aspect = width / height
    scene.paint(scene.y > 0, GREY_PATCH, WHITE_PATCH, 0.5, 1 + 0.02 * smooth_noise((height, width), 4, rng))
    order = rng.permutation(count)
    side = np.sqrt(aspect / count)
    columns = int(np.ceil(aspect / side))
    for place, surface in enumerate(order):
        row, column = divmod(place, columns)
        x = (column + 0.5 + rng.uniform(-0.12, 0.12)) * side
        y = (row + 0.5 + rng.uniform(-0.12, 0.12)) * side
        angle, sheen = rng.normal(0, 0.06), rng.uniform(0.75, 1.0)
        spot = scene.window(x, y, 1.4 * side)
        spot.soft_shadow(x + 0.012, y + 0.016, 0.5 * side, 0.5 * side, 0.3)
        mask, u, v = spot.card(x, y, 0.9 * side, 0.94 * side, angle)
        spot.paint(mask, WHITE_PATCH, shade=sheen)
        sample = mask & (np.abs(u - 0.5) < 0.45) & (v > 0.05) & (v < 0.84)
        pale = (v > 0.58) & (place % 3 == 0)
        spot.paint(sample, 24 + int(surface), WHITE_PATCH, np.where(pale, 0.45, 0.0), sheen * (1.03 - 0.06 * v))
    edge = scene.x + 0.35 * scene.y - aspect * 0.72
    scene.darken(0.72 / (1 + np.exp(-edge / 0.05)))
    pool = np.exp(-((scene.x - 0.3 * aspect) ** 2 + (scene.y - 0.4) ** 2) / 0.8)
    scene.darken(0.25 * (1 - pool))
    return scene.vignetted()


def still_life(height: int = 800, width: int = 1200, seed: int = 0) -> Scene:
    """Glossy and matt balls, cards and a small chart on a table before a backdrop that fades into shade."""
    rng = np.random.default_rng([seed, 3])
    shape = (height, width)
    aspect = width / height
    horizon = 0.6
    scene = Scene.blank(height, width, palette(60, rng))

    # Backdrop and table
    cloth, wall = (int(i) for i in rng.choice((2, 3, 4, 7, 9, 12, 0, 5), 2, replace=False))
    pool = np.exp(-((scene.x - 0.36 * aspect) ** 2 / 0.5 + (scene.y - 0.28) ** 2 / 0.22))
    scene.paint(scene.y < horizon, wall, GREY_PATCH, 0.35 + 0.3 * scene.y, 0.16 + 0.95 * pool)
    weave = 0.035 * smooth_noise(shape, 2, rng) + 0.05 * smooth_noise(shape, 40, rng)
    near = np.clip((scene.y - horizon) / (1 - horizon), 0, 1)
    lit = (0.55 + 0.5 * near) * (1.06 - 0.5 * (scene.x / aspect - 0.35) ** 2)
    scene.paint(scene.y >= horizon, cloth, WHITE_PATCH, 0.25 + 0.15 * near, lit * (1 + weave))
    scene.darken(0.35 * np.exp(-(((scene.y - horizon) / 0.035) ** 2)))

    # Coloured cards that lean against the backdrop, one with stripes, one with a gradient
    colors = rng.choice((6, 10, 11, 14, 15, 16, 17, 13), 6, replace=False)
    for place, color in enumerate(int(i) for i in colors):
        x = (0.1 + 0.125 * place) * aspect + rng.uniform(-0.02, 0.02)
        tall, angle = rng.uniform(0.26, 0.42), rng.normal(0, 0.05)
        y = 0.66 - tall / 2
        scene.soft_shadow(x + 0.05, y + 0.03, 0.12, 0.5 * tall, 0.45)
        mask, u, v = scene.card(x, y, 0.17, tall, angle)
        light = (0.95 - 0.45 * abs(x / aspect - 0.33)) * (1.0 - 0.25 * v)
        second = 24 + int(rng.integers(60))
        stripes, gradient = (np.floor(v * 9) % 2) * (abs(u - 0.5) < 0.42), np.clip(v, 0, 1)
        scene.paint(mask, color, second, (stripes, gradient, 0.0)[place % 3], light)
    scene.soft_shadow(0.885 * aspect + 0.02, 0.665, 0.2, 0.04, 0.5)
    scene.chart(0.86 * aspect, 0.53, 0.33, rng.uniform(-0.03, 0.03), 0.9)

    # Balls from the back row to the front; some two-coloured like fruit, some glossy enough to clip
    for row, (base, count, size) in enumerate(((0.74, 5, 0.085), (0.87, 5, 0.105))):
        for place in range(count):
            x = (0.1 + 0.06 * row + 0.155 * place) * aspect + rng.uniform(-0.03, 0.03)
            radius = size * rng.uniform(0.75, 1.15)
            first = int(rng.choice((11, 12, 13, 14, 15, 16, 17, 6, 10, 18)))
            second = int(rng.choice((10, 11, 14, 15, 5, 8, 24 + int(rng.integers(60)))))
            fruit = 0.3 + 0.5 * (scene.y - base) / radius + 0.05 * smooth_noise(shape, 25, rng)
            mix = np.clip(fruit, 0, 1) if place % 2 else 0.0
            scene.ball(x, base - radius, radius, first, second, mix, float(rng.choice((0.0, 0.5, 1.6))))
    return scene.vignetted(0.2)


SCENES: Mapping[str, Callable[[int, int, int], Scene]] = {
    "chart": chart_scene,
    "wall": paint_wall,
    "still-life": still_life,
}
"""The scenes by name: height, width, seed → scene."""
