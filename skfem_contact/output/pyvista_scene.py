"""Pictures in space that turn, with PyVista (the extra ``scene``): what is behind is hidden."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from skfem_contact.answers.result import ContactResult
from skfem_contact.arguments import known_keywords, members
from skfem_contact.bodies.member import Member
from skfem_contact.errors import InputError
from skfem_contact.output.drawing import FRICTION, LONGEST, is_solid, limits
from skfem_contact.output.fields import OneStress, checked_units, quantity
from skfem_contact.output.plot_bodies import colour_name, colours
from skfem_contact.output.solids import body_part, colour_map, plotter_of, tool_parts
from skfem_contact.output.view import View, view, with_tools


@known_keywords()
def scene(
    result: ContactResult,
    scale: float | Literal["auto"] = "auto",
    stress: OneStress | None = None,
    *,
    bodies: Sequence[Member | str] | None = None,
    component: str | None = None,
    arrows: bool = True,
    label: str | None = None,
    cmap: str = "YlGnBu",
    units: Mapping[str, str] | None = None,
    off_screen: bool | None = None,
) -> Any:
    """The deformed bodies and rigid obstacles in space, to be turned, or to be saved as a picture.

    Better than `plot_deformed` where bodies hide each other. It needs PyVista, which has a window of
    its own and a form for notebooks.

    Parameters
    ----------
    result : ContactResult
    scale, stress, component, label, cmap, units
        As in `plot_deformed`.
    bodies : sequence of Body or str, optional
        Those that are shown: what touches is seen with the body before it left out. By default all.
    arrows : bool
        Draw the traction on the secondary surfaces of solids, if their bodies are shown.
    off_screen : bool, optional
        Without a window, for ``screenshot``; by default as PyVista is set up.

    Returns
    -------
    pyvista.Plotter
        ``.show()`` opens it, ``.screenshot("picture.png")`` saves it, and all else of PyVista is there.

    Raises
    ------
    InputError
        If PyVista is missing, the problem has no displacements, or there is no such body.

    Examples
    --------
    Without PyVista the scene says what to install; with it the last two lines save a picture.

    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshHex().refined(1).with_boundaries({"low": lambda x: x[2] < 1e-9})
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    >>> cube = sc.Body(basis, linear_elasticity(), f={"low": (0, 0, -1e-3)}, name="cube")
    >>> floor = sc.RigidPlane((0, 0, 0), (0, 0, 1))
    >>> glue = sc.Contact(cube.surface("low"), floor, tied=True)
    >>> result = sc.ContactSolver(cube, glue).solve()
    >>> plotter = sc.output.scene(result, off_screen=True)  # doctest: +SKIP
    >>> plotter.screenshot("cube.png")  # doctest: +SKIP
    """
    solid, words = is_solid(result), checked_units(units)
    try:
        import pyvista  # optional, and slow to import
    except ImportError:
        raise InputError(
            "scene needs PyVista, which is not installed: pip install 'skfem-contact[scene]'; "
            "plot_deformed draws solids by matplotlib"
        ) from None
    seen, shown = view(result, scale), _chosen(result, bodies)
    label = label or colour_name(stress, component, words)
    values = [colours(result, body, stress, component) for body in shown]
    parts = [body_part(result, body, seen, v) for body, v in zip(shown, values, strict=True)]
    x = np.concatenate([part.points for part in parts])[:, : 3 if solid else 2]
    low, high = x.min(axis=0), x.max(axis=0)
    parts += tool_parts(result, seen, with_tools(result, seen, (low, high)))
    # wide labels of the last tick stay in the picture
    bar = {"title": f"{label}\n", "color": "black", "fmt": "%.3g", "width": 0.5, "position_x": 0.3}
    plotter = plotter_of(pyvista, parts, colour_map(cmap, limits(values)), off_screen, **bar)
    remarks = [seen.words]
    if arrows and solid:
        remarks += _arrows(pyvista, plotter, result, shown, seen, float(np.max(high - low)), words)
    plotter.add_text("\n".join(remarks), font_size=9, color="black")
    plotter.add_axes(color="black")
    plotter.camera_position = "iso" if solid else "xy"
    return plotter


def _chosen(result: ContactResult, bodies: Sequence[Member | str] | None) -> list[Any]:
    """The bodies that are shown."""
    solids = list(result.system.solids.values())
    if bodies is None:
        return solids
    usage = "give bodies of the result, or their names"
    # of either kind: a string is one name, not a sequence of letters
    given = members(bodies, (Member, str), "bodies", usage, "Body or name")
    wished = [result.system.bodies[result.system.index(body)] for body in given]
    found = [body for body in solids if any(body is own for own in wished)]
    if not found:
        raise InputError(f"bodies has none with a mesh; {usage}")
    return found


def _arrows(
    pyvista: Any,
    plotter: Any,
    result: ContactResult,
    shown: list[Any],
    seen: View,
    size: float,
    units: Mapping[str, str],
) -> list[str]:
    """Tractions on secondary surfaces, the longest 8 % of the scene; what is to be said of them."""
    drawn = [values for values in result if any(values.surface.body is body for body in shown)]
    lengths = [np.linalg.norm(values.traction, axis=1) for values in drawn]
    peak = max((float(length.max(initial=0.0)) for length in lengths), default=0.0)
    if peak == 0.0:
        return []
    for values in drawn:
        way = LONGEST * size / peak * values.traction
        tails = pyvista.PolyData(seen.surface(result, values.surface) - way)
        tails.point_data["way"] = way
        glyphs = tails.glyph(orient="way", scale="way", factor=1.0)
        if glyphs.n_points:  # PyVista refuses empty meshes
            plotter.add_mesh(glyphs, color=FRICTION)
    return [f"longest arrow: {quantity(peak, 'stress', units)}"]
