"""The tables of docs/checks/effectivity.md, which both benchmarks of the error estimate write."""

from __future__ import annotations

from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parent / "results"
PAGE = Path(__file__).parents[1] / "docs" / "checks" / "effectivity.md"
PLANE = "<!-- effectivity table: begin -->", "<!-- effectivity table: end -->"
SOLIDS = "<!-- effectivity of solids: begin -->", "<!-- effectivity of solids: end -->"
LOW, HIGH = 0.3, 3.0


def both(found: Any) -> list[float]:
    """A number of the pressure and one of the traction, as they are stored."""
    return list(found.values()) if isinstance(found, dict) else list(found)


def inside(row: dict[str, Any]) -> bool:
    """Whether both estimates are within a factor of three or so."""
    return all(LOW <= e <= HIGH for e in both(row["effectivity"]))


def table(rows: list[dict[str, Any]]) -> str:
    """The table in Markdown; effectivities beyond the bounds are bold."""
    lines = [
        "| problem | true error: pressure | traction | estimated | | effectivity | |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        cells = [f"{100 * v:.2g} %" for key in ("true", "estimated") for v in both(row[key])]
        for e in both(row["effectivity"]):
            cells.append(f"{e:.2f}" if LOW <= e <= HIGH else f"**{e:.2f}**")
        lines.append(f"| {row['problem']} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def write(rows: list[dict[str, Any]], marks: tuple[str, str]) -> None:
    """Put a table between its marks."""
    begin, end = marks
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(begin)
    after = rest.partition(end)[2]
    PAGE.write_text(f"{before}{begin}\n{table(rows)}\n{end}{after}", encoding="utf-8")
