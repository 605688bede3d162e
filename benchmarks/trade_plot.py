"""The pictures of `trade.py`: fronts, and what every setting costs and buys."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.ticker import LogLocator, NullFormatter
from trade_tables import front

IMAGES = Path(__file__).parents[1] / "docs" / "images"
COLOURS = {"P1": "C0", "Q1": "C1", "P2": "C2", "Q2": "C3"}
STYLES = {"node": "o--", "mortar": "s-"}
#: Of each setting: the quantity over that of the base, marker, colour and name.
MARKS = (("time ratio", "|", "C0", "time"), ("error ratio", "o", "C3", "error"))
#: A factor below which a time or an error is that of the base: times differ by as much in two runs.
SEEN = 1.15
Row = dict[str, Any]


def draw(stored: Row, folder: Path = IMAGES) -> list[Path]:
    """All pictures."""
    return [fronts(stored, folder), hertz(stored, folder), prices(stored, folder)]


def lines(ax: Any, rows: list[Row]) -> None:
    """Error over time, a line for each element and method."""
    for kind, colour in COLOURS.items():
        for method, style in STYLES.items():
            mine = [
                r
                for r in rows
                if r["axis"] == "front"
                and "failed" not in r
                and (r["setting"]["kind"], r["setting"]["method"]) == (kind, method)
            ]
            if mine:
                seconds = [r["median"] for r in mine]
                errors = [100 * r["error"] for r in mine]
                label = f"{kind}, {method}"
                ax.loglog(seconds, errors, style, color=colour, markersize=4, label=label)
    ax.grid(which="both", alpha=0.2)
    for axis in (ax.xaxis, ax.yaxis):
        plain_numbers(axis)


def plain_numbers(axis: Any) -> None:
    """1, 2, 5, 10 at a logarithmic axis, whatever part of a decade it shows."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def fronts(stored: Row, folder: Path) -> Path:
    """The four problems; what nothing beats in both is joined by a grey line."""
    figure, axes = plt.subplots(2, 2, figsize=(10, 8), layout="constrained")
    for ax, problem in zip(axes.flat, stored["problems"].values(), strict=True):
        best = front(problem["rows"])
        ax.plot(
            [r["median"] for r in best],
            [100 * r["error"] for r in best],
            color="0.85",
            lw=7,
            zorder=0,
            label="front",
        )
        lines(ax, problem["rows"])
        ax.set(title=problem["title"], xlabel="CPU seconds, assembly included", ylabel="error [%]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False)
    return saved(figure, folder / "trade_fronts.png")


def hertz(stored: Row, folder: Path) -> Path:
    """Hertz alone, larger."""
    figure, ax = plt.subplots(figsize=(6.5, 4.5), layout="constrained")
    lines(ax, stored["problems"]["hertz"]["rows"])
    ax.set(xlabel="CPU seconds, assembly included", ylabel="L2 error of the pressure [%]")
    ax.legend(ncols=2, frameon=False, fontsize="small")
    return saved(figure, folder / "trade_hertz.png")


def prices(stored: Row, folder: Path) -> Path:
    """Time and error over those of the base: the settings that change one of them, quickest first."""
    shown = {}
    for problem in stored["problems"].values():
        rows = [r for r in problem["rows"] if r["axis"] not in ("base", "front") and "failed" not in r]
        seen = [r for r in rows if any(not 1 / SEEN < r[key] < SEEN for key, *_ in MARKS)]
        title = f"{problem['title']} ({len(rows) - len(seen)} more are within {SEEN - 1:.0%})"
        shown[title] = sorted(seen, key=lambda r: r["time ratio"])
    columns = [list(shown.items())[::2], list(shown.items())[1::2]]
    figure = plt.figure(figsize=(11, 9), layout="constrained")
    for part, column in zip(figure.subfigures(1, 2), columns, strict=True):
        heights = [len(rows) + 3 for _, rows in column]
        axes = part.subplots(len(column), 1, height_ratios=heights, squeeze=False)[:, 0]
        for ax, (title, rows) in zip(axes, column, strict=True):
            place = range(len(rows))
            ax.axvline(1.0, color="0.6", lw=1)
            for key, marker, colour, label in MARKS:
                values = [r[key] for r in rows]
                ax.plot(values, place, marker, color=colour, ms=11 if marker == "|" else 6, mew=2.5)
                ax.plot([], [], marker, color=colour, mew=2.5, label=label)
            ax.set_yticks(place, [f"{r['axis']} {r['label']}" for r in rows])
            ax.set(xscale="log", xlabel="over the base")
            ax.set_title(title, fontsize="medium", loc="left")
            plain_numbers(ax.xaxis)
            ax.grid(axis="y", alpha=0.25)
            ax.invert_yaxis()
    figure.axes[0].legend(frameon=False, loc="center right")
    return saved(figure, folder / "trade_prices.png")


def saved(figure: Any, path: Path) -> Path:
    """Write and close."""
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return path
