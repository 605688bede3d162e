"""The order of the gallery, and what a thumbnail shows of a picture.

Examples stand from simple to rich, and solids early: first pressure alone, then friction and histories,
bolts, what slides far, bodies that yield and stretch, and last wear, fretting and squeal.
Pictures have several axes, whose words nobody can read in a thumbnail: it shows the part that is named
here, as (left, top, right, bottom) of the picture.
"""

from __future__ import annotations

from pathlib import Path

from PIL import Image

WHOLE = (0.0, 0.0, 1.0, 1.0)
#: Examples in the order of the gallery.
PARTS = {
    "hertz": (0.0, 0.0, 0.53, 1.0),
    "stl_brake": (0.0, 0.075, 0.545, 1.0),
    "ball_joint": (0.06, 0.058, 0.442, 0.872),
    "gear_pair": (0.0, 0.0, 0.53, 1.0),
    "press_fit": (0.0, 0.0, 0.302, 1.0),
    "heat_across_interface": (0.0, 0.13, 0.25, 0.82),
    "pin_in_lug": (0.0, 0.0, 0.491, 1.0),
    "adaptive_hertz": (0.0, 0.0, 0.53, 1.0),
    "clutch": (0.0, 0.0, 0.538, 1.0),
    "mindlin_ball": (0.0, 0.0, 0.516, 1.0),
    "block_on_slope": (0.68, 0.0, 1.0, 0.45),
    "wedge": (0.0, 0.0, 1.0, 0.455),
    "belt": (0.0, 0.0, 0.346, 0.85),
    "own_friction_law": (0.0, 0.0, 0.522, 0.583),
    "bolted_flange": (0.0, 0.045, 0.473, 1.0),
    "tightened_flange": (0.34, 0.0, 0.665, 0.332),
    "lap_joint": (0.582, 0.0, 1.0, 1.0),
    "leaking_flange": (0.643, 0.0, 1.0, 1.0),
    "die_set": (0.0, 0.0, 0.463, 1.0),
    "smallest_interference": (0.0, 0.0, 0.363, 1.0),
    "ironing": (0.0, 0.0, 1.0, 0.555),
    "towing_wheel": (0.0, 0.0, 1.0, 0.545),
    "braked_ball": (0.616, 0.04, 1.0, 0.55),
    "forging": (0.0, 0.0, 0.422, 1.0),
    "yielding_fit": (0.0, 0.0, 0.387, 1.0),
    "nonlinear_body": (0.0, 0.0, 1.0, 0.466),
    "rubber_seal": (0.0, 0.0, 0.353, 1.0),
    "rubber_ironing": (0.0, 0.0, 1.0, 0.557),
    "wear": (0.01, 0.1, 0.31, 0.92),
    "fretting_map": (0.0, 0.0, 0.551, 1.0),
    "fretting_calibration": (0.0, 0.065, 0.407, 0.9),
    "squeal": (0.013, 0.065, 0.511, 0.95),
}
#: The largest width and height [pixels], and the number of colours.
SIZE, COLOURS = (400, 280), 64


class Order:
    """The place of an example in the gallery; one that is not listed stands at the end."""

    def __call__(self, path: Path) -> tuple[int, str]:
        names = list(PARTS)
        return (names.index(path.stem) if path.stem in names else len(names), path.stem)


def thumbnail(picture: Path, file: Path) -> None:
    """The part of a picture that its example names, in the size of a thumbnail."""
    with Image.open(picture) as image:
        wide, high = image.size
        left, top, right, bottom = PARTS.get(picture.stem, WHOLE)
        part = image.convert("RGB").crop(
            (round(left * wide), round(top * high), round(right * wide), round(bottom * high))
        )
    part.thumbnail(SIZE, Image.LANCZOS)
    file.parent.mkdir(parents=True, exist_ok=True)
    part.save(file)


def with_few_colours(folder: Path) -> None:
    """Pictures of a folder as small files: of a thumbnail nobody sees the difference."""
    for file in folder.glob("*.png"):
        with Image.open(file) as image:
            few = image.convert("RGB").quantize(COLOURS)
        few.save(file, optimize=True)
