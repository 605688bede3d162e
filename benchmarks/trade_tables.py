"""The tables of `trade.py`: printed, and written between the marks in the docs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1] / "docs"
Row = dict[str, Any]


def percent(value: float) -> str:
    """Two significant digits."""
    return f"{100 * value:.2g} %" if value < 1 else f"{100 * value:.0f} %"


def ratio(value: float) -> str:
    """Two decimals, or whole where it is large."""
    return f"{value:.2f}" if value < 10 else f"{value:.0f}"


def moved(value: float | None) -> str:
    """The change of the forces; round-off is called so."""
    if value is None:
        return ""
    return "0" if value < 1e-9 else f"{value:.0e}"


def table(head: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def front(rows: list[Row]) -> list[Row]:
    """The rows of the front that no other beats in both time and error, the fastest first."""
    candidates = [r for r in rows if r["axis"] == "front" and "failed" not in r]
    best: list[Row] = []
    for row in sorted(candidates, key=lambda r: r["median"]):
        if not best or row["error"] < best[-1]["error"]:
            best.append(row)
    return best


def front_table(problem: Row) -> str:
    """What is worth taking, by time."""
    rows = [
        [
            row["label"].rsplit(",", 1)[0],
            f"{row['setting']['points']:g}",
            f"{row['dofs']}",
            f"{row['median']:.2f}",
            percent(row["error"]),
        ]
        for row in front(problem["rows"])
    ]
    return table(["elements, method", "nodes", "DOFs", "s", "error"], rows)


def price_list(problem: Row) -> str:
    """What every setting costs and buys."""
    rows = []
    for row in problem["rows"]:
        if row["axis"] == "front":
            continue
        what = [row["axis"], row["label"]]
        if "failed" in row:
            rows.append([*what, row["failed"], "", "", "", "", ""])
            continue
        rows.append(
            [
                *what,
                f"{row['median']:.2f}",
                ratio(row["time ratio"]),
                percent(row["error"]),
                f"{row['error ratio']:.3f}",
                moved(row["moved"]),
                str(row["iterations"]),
            ]
        )
    numbers = ["s", "time / base", "error", "error / base", "forces moved"]
    return table(["what", "setting", *numbers, "iterations"], rows)


def preset_table(stored: Row) -> str:
    """The presets on all problems."""
    rows = []
    for problem in stored["problems"].values():
        for row in problem["rows"]:
            if row["axis"] == "presets":
                rows.append(
                    [
                        problem["title"],
                        f"`Options.{row['label']}()`",
                        f"{row['median']:.2f}",
                        ratio(row["time ratio"]),
                        percent(row["error"]),
                        f"{row['error ratio']:.4f}",
                        moved(row["moved"]),
                        f"{row['placement']:.0e}" if row["placement"] else "",
                    ]
                )
    numbers = ["s", "time / base", "error", "error / base", "forces moved"]
    return table(["problem", "preset", *numbers, "placement"], rows)


def hertz_table(stored: Row) -> str:
    """Node to segment beside mortar, for docs/checks/methods.md."""
    rows = [r for r in stored["problems"]["hertz"]["rows"] if r["axis"] == "front"]
    by = {(r["setting"]["kind"], r["setting"]["points"], r["setting"]["method"]): r for r in rows}
    lines = []
    for kind, points, method in by:
        if method == "mortar":
            continue
        node, mortar = by[kind, points, "node"], by[kind, points, "mortar"]
        numbers = [text for r in (node, mortar) for text in (percent(r["error"]), f"{r['median']:.2f}")]
        lines.append([kind, f"{points:g}", str(node["dofs"]), *numbers])
    head = ["elements", "nodes per half width", "DOFs", "node: error", "s", "mortar: error", "s"]
    return table(head, lines)


def tables(stored: Row) -> dict[str, dict[str, str]]:
    """All tables, by page and name."""
    out = {"presets": preset_table(stored)}
    for name, problem in stored["problems"].items():
        out[f"{name} front"], out[f"{name} prices"] = front_table(problem), price_list(problem)
    return {"checks/trade.md": out, "checks/methods.md": {"hertz": hertz_table(stored)}}


def show(stored: Row) -> None:
    """Print them."""
    for name, problem in stored["problems"].items():
        print(f"\n{problem['title']} ({name}): {problem['measure']}\n")
        print(front_table(problem) + "\n\n" + price_list(problem))
    print("\n" + preset_table(stored))
    print(f"\n{stored['machine']}, {stored['rounds']} rounds, {stored['cpu seconds']:.0f} s in all")


def marked(text: str, name: str, new: str | None = None) -> str:
    """The text between the marks of a table, or the whole text with a new one."""
    begin, end = f"<!-- trade, {name}: begin -->\n", f"\n<!-- trade, {name}: end -->"
    found = re.search(re.escape(begin) + "(.*?)" + re.escape(end), text, re.DOTALL)
    if found is None:
        raise LookupError(f"the page has no marks for the table '{name}'")
    return found[1] if new is None else text[: found.start(1)] + new + text[found.end(1) :]


def write(stored: Row) -> None:
    """Put the tables into the pages."""
    for page, wanted in tables(stored).items():
        path = DOCS / page
        text = path.read_text(encoding="utf-8")
        for name, new in wanted.items():
            text = marked(text, name, new)
        path.write_text(text, encoding="utf-8")
