"""The picture of valleys with and without effects, side by side over the material's parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from bayesmembrane.ground.parameters import Array
from bayesmembrane.report.blocks import Picture
from bayesmembrane.report.canvas import encoded, new_figure, style
from bayesmembrane.report.style import FAINT, INK, RANGE_COLOURS, with_unit
from bayesmembrane.valleys.beside import Beside
from bayesmembrane.valleys.result import Between, Valley
from bayesmembrane.words.hypothesis import title
from bayesmembrane.words.language import listed
from bayesmembrane.words.valleys import loss_of, up_to

DOTS = 600


def beside_picture(found: Beside, kind: str = "png") -> Picture:
    """A panel for each range: floors, optima and posterior draws, without effects and with them."""
    names = listed(map(title, found.added.hypothesis.effects))
    count = len(found.pairs)
    with style():
        figure = new_figure(4.6)
        axes = figure.subplots(1, count, squeeze=False)[0]
        shown = _shown(found.without.ranges[0])
        for ax, pair, a, b in zip(axes, found.pairs, found.without.ranges, found.added.ranges, strict=True):
            for v, c, words in ((a, RANGE_COLOURS[0], "without"), (b, RANGE_COLOURS[1], f"with {names}")):
                _valley(ax, shown, a, v, c, f"{words}: least loss {loss_of(v, v.best_loss, 3)}")
            _approach(ax, shown, a, pair)
            ax.set_title(up_to(a))
            ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16))
        text = f"{title(found.added.hypothesis.material)}: valleys without and with {names} (dots: posterior draws)"
        figure.suptitle(text, fontweight="bold")
        return encoded(figure, kind)


def _shown(v: Valley) -> tuple[int, int | None]:
    """Which of the material's parameters are x and y, alike in all panels; only x if there is one."""
    k = v.best.size
    if k == 1:
        return 0, None
    spread = np.diag(v.spread.covariance).copy()
    spread[v.along] = -1.0
    x, y = sorted((v.along, int(np.argmax(spread))))
    return x, y


def _valley(ax: Axes, shown: tuple[int, int | None], plain: Valley, v: Valley, c: str, text: str) -> None:
    """Floor, optimum and posterior of one valley over two parameters of ``plain``."""
    x, y = shown
    k = plain.best.size
    height = 0.0 if v is plain else 1.0
    star = _natural(plain, v.best_z[None, :k])
    floor = _natural(plain, v.floor_z[:, :k])
    if y is None:
        ax.plot(floor[:, x], np.full(len(floor), height), color=c, linewidth=3.0, label=text)
        ax.plot(star[:, x], [height], "*", color=c, markersize=14, markeredgecolor="white", zorder=6)
        ax.set_yticks([0, 1], ["without", "with"])
        ax.set_ylim(-0.6, 1.6)
    else:
        ax.plot(floor[:, x], floor[:, y], color=c, linewidth=2.4, label=text)
        ax.plot(star[:, x], star[:, y], "*", color=c, markersize=14, markeredgecolor="white", zorder=6)
        dots = _draws(plain, v)
        ax.plot(dots[:, x], dots[:, y], ".", color=c, alpha=0.25, markersize=3, markeredgewidth=0, zorder=1)
        ax.set_ylabel(_name(plain, y))
    ax.set_xlabel(_name(plain, x))
    ax.grid(color=FAINT, linewidth=0.6)
    # Axes are those of the logarithm where all its values have one sign.
    for i, scale in ((x, ax.set_xscale), (y, ax.set_yscale)):
        if i is not None and plain.chart.log[i] and np.ptp(np.log(floor[:, i])) > np.log(4):
            scale("log")


def _draws(plain: Valley, v: Valley) -> Array:
    """At most `DOTS` posterior draws (M, k) of the parameters of ``plain``."""
    z = v.spread.draws
    return _natural(plain, z[:: max(1, len(z) // DOTS), : plain.best.size])


def _natural(plain: Valley, z: Array) -> Array:
    """Parameters (M, k), magnitudes where the axis is logarithmic."""
    p = plain.chart.natural(z)
    return np.where(plain.chart.log, np.abs(p), p)


def _name(v: Valley, i: int) -> str:
    name = with_unit(v.chart.names[i], v.chart.units[i])
    return f"-{name}" if v.chart.log[i] and v.chart.sign[i] < 0 else name


def _approach(ax: Axes, shown: tuple[int, int | None], a: Valley, pair: Between) -> None:
    x, y = shown
    ends: Sequence[Array] = [_natural(a, p[None, :])[0] for p in (pair.approach.first, pair.approach.second)]
    up = [0.0, 1.0] if y is None else [float(p[y]) for p in ends]
    ax.plot([float(p[x]) for p in ends], up, color=INK, linewidth=1.2, linestyle=(0, (2, 2)), zorder=5)
    words = f"closest: {pair.approach.distance:.2g} posterior sd apart" if pair.approach.distance > 0 else "they meet"
    # Above the panel, where no draws lie.
    ax.set_title(words, loc="right", color=INK, fontweight="normal", fontsize="medium")
