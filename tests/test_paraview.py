"""Files as ParaView sees them: read and rendered by VTK, where it is installed, else read by meshio."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity

import skfem_contact as sc

KINDS: dict[str, tuple[Any, Any]] = {
    "triangle": (fem.MeshTri, fem.ElementTriP1),
    "triangle6": (fem.MeshTri, fem.ElementTriP2),
    "quad": (fem.MeshQuad, fem.ElementQuad1),
    "quad8": (fem.MeshQuad, fem.ElementQuadS2),
    "quad9": (fem.MeshQuad, fem.ElementQuad2),
    "tetra": (fem.MeshTet, fem.ElementTetP1),
    "tetra10": (fem.MeshTet, fem.ElementTetP2),
    "hexahedron": (fem.MeshHex, fem.ElementHex1),
    "hexahedron20": (fem.MeshHex, fem.ElementHexS2),
    "hexahedron27": (fem.MeshHex, fem.ElementHex2),
}
UNITS = {"length": "mm", "stress": "MPa", "force": "N"}
needs_vtk = "VTK is not installed: pip install vtk (the extra 'test' has it)"


def pressed(kind: str = "quad") -> sc.answers.ContactResult:
    """A unit square or cube of modulus 1, its floor moved up by one per cent."""
    mesh, element = KINDS[kind]
    mesh = mesh().refined(1)
    d = mesh.dim()
    grid = mesh.with_boundaries(
        {"top": lambda x: x[d - 1] > 0.999, "bottom": lambda x: x[d - 1] < 0.001}
    )
    basis = fem.Basis(grid, fem.ElementVector(element()))
    block = sc.Body(basis, linear_elasticity(0.0, 0.5), D="top", name="the block")
    up = np.eye(d)[-1]
    floor = sc.RigidPlane(0 * up, up, name="floor")
    contact = sc.Contact(block.surface("bottom"), floor, name="joint", friction=sc.Coulomb(0.3))
    solver = sc.ContactSolver([block], [contact])
    return next(solver.history([{"motion": {"floor": 0.01 * up}}]))


def sigma(body: sc.Body, u: np.ndarray) -> np.ndarray:
    return sc.nodal_stress(body, u, E=1.0, nu=0.0)


def grid_of(path: Path) -> Any:
    """What VTK reads."""
    xml = pytest.importorskip("vtkmodules.vtkIOXML", reason=needs_vtk)
    reader = xml.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def array(grid: Any, name: str) -> np.ndarray:
    numpy_support = pytest.importorskip("vtkmodules.util.numpy_support", reason=needs_vtk)
    return np.asarray(numpy_support.vtk_to_numpy(grid.GetPointData().GetArray(name)))


def test_meshio_reads_tensors_and_names(tmp_path: Path) -> None:
    """Six components in VTK's order, names in the field data, the load factor as time."""
    result = pressed()
    file, contacts = sc.write(tmp_path / "a.vtu", result, stress=sigma, time=2.5, units=UNITS)
    mesh = meshio.read(file)
    assert_allclose(mesh.point_data["sigma"], np.tile([0, -0.01, 0, 0, 0, 0], (9, 1)), atol=1e-12)
    assert mesh.field_data["TimeValue"] == 2.5 and mesh.field_data["body 1: the block"] == 1
    assert meshio.read(contacts).field_data["contact 1: joint"] == 1
    floor = meshio.read(tmp_path / "a_obstacles.vtu")
    assert floor.field_data["obstacle 1: floor"] == 1
    assert_allclose(floor.points[:, 1], 0.0, atol=1e-12)
    assert_allclose(floor.point_data["displacement"][:, 1], 0.01)


def test_tensors_are_in_the_order_of_vtk(tmp_path: Path) -> None:
    """XX, YY, ZZ, XY, YZ, XZ, from a tensor whose entries say where they stand; factors are times."""

    def where(body: sc.Body, u: np.ndarray) -> np.ndarray:
        tensor = np.array([[11.0, 12, 13], [12, 22, 23], [13, 23, 33]])
        return np.tile(tensor, (body.n // body.dim, 1, 1))

    basis = fem.Basis(fem.MeshHex().refined(1), fem.ElementVector(fem.ElementHex1()), intorder=2)
    cube = sc.Body(basis, linear_elasticity(), f=1e-6 - basis.doflocs[2] * 1e-5, name="cube")
    glue = sc.Contact(
        cube.surface(lambda x: x[2] < 1e-9), sc.RigidPlane((0, 0, 0), (0, 0, 1)), tied=True
    )
    (result,) = sc.ContactSolver(cube, glue).history([0.75])
    mesh = meshio.read(sc.write(tmp_path / "a.vtu", result, stress=where)[0])
    assert mesh.point_data["where"][3].tolist() == [11, 22, 33, 12, 23, 13]
    assert mesh.field_data["TimeValue"] == mesh.field_data["load factor"] == 0.75


def test_several_fields_by_name(tmp_path: Path) -> None:
    """A dict names them, a list takes the names of the functions, doubles are refused."""
    result, mises = pressed(), partial(sc.von_mises, E=1.0, nu=0.0)
    fields = {"σ": sigma, "von Mises": mises, "u again": lambda body, u: u.reshape(-1, 2)}
    data = meshio.read(sc.write(tmp_path / "a.vtu", result, stress=fields)[0]).point_data
    assert [data[name].shape for name in fields] == [(9, 6), (9,), (9, 3)]
    data = meshio.read(sc.write(tmp_path / "a.vtu", result, stress=[sigma, mises])[0]).point_data
    assert {"sigma", "von_mises"} <= set(data)
    with pytest.raises(sc.errors.InputError, match="two fields have the same name"):
        sc.write(tmp_path / "a.vtu", result, stress=[mises, mises])
    with pytest.raises(
        sc.errors.InputError, match=r"has no field 'von_mises'.* or a function \(body, u\)"
    ):
        sc.write(tmp_path / "a.vtu", result, stress="von_mises")
    with pytest.raises(sc.errors.InputError, match=r"give the name of a field .*, or a function"):
        sc.write(tmp_path / "a.vtu", result, stress=[3])  # type: ignore[list-item]


@pytest.mark.parametrize("kind", KINDS)
def test_vtk_reads_cells_of_every_kind(kind: str, tmp_path: Path) -> None:
    """VTK finds the volume of the body, and the gradient of its displacement in every cell."""
    filters = pytest.importorskip("vtkmodules.vtkFiltersVerdict", reason=needs_vtk)
    general = pytest.importorskip("vtkmodules.vtkFiltersGeneral", reason=needs_vtk)
    result = pressed(kind)
    grid = grid_of(sc.write(tmp_path / "a.vtu", result)[0])
    size = filters.vtkCellSizeFilter()
    size.SetInputData(grid)
    size.Update()
    found = size.GetOutput().GetCellData()
    d = next(iter(result.system.solids.values())).dim
    measure = found.GetArray("Area" if d == 2 else "Volume")
    volumes = [measure.GetValue(i) for i in range(measure.GetNumberOfTuples())]
    assert min(volumes) > 0 and sum(volumes) == pytest.approx(1.0)
    slope = general.vtkGradientFilter() if hasattr(general, "vtkGradientFilter") else None
    if slope is not None:  # by VTK's own shape functions: nodes in another order would not give it
        slope.SetInputData(grid)
        slope.SetInputScalars(0, "displacement")
        slope.SetResultArrayName("slope")
        slope.Update()
        gradient = array(slope.GetOutput(), "slope").reshape(-1, 3, 3)
        assert_allclose(gradient[:, d - 1, d - 1], -0.01, rtol=0, atol=1e-9)


def test_vtk_knows_units_and_components(tmp_path: Path) -> None:
    """Units are where VTK looks for them, tensors have named components, names stand in the fields."""
    core = pytest.importorskip("vtkmodules.vtkCommonCore", reason=needs_vtk)
    file, contacts = sc.write(tmp_path / "a.vtu", pressed(), stress=sigma, units=UNITS)
    grid = grid_of(file)
    stress = grid.GetPointData().GetArray("sigma")
    assert [stress.GetComponentName(i) for i in range(6)] == ["XX", "YY", "ZZ", "XY", "YZ", "XZ"]
    unit = core.vtkDataArray.UNITS_LABEL()
    assert stress.GetInformation().Get(unit) == "MPa"
    assert grid_of(contacts).GetPointData().GetArray("gap").GetInformation().Get(unit) == "mm"
    fields = grid.GetFieldData()
    names = [fields.GetAbstractArray(i).GetName() for i in range(fields.GetNumberOfArrays())]
    assert names == ["body 1: the block"]


def test_vtk_renders_what_is_written(tmp_path: Path) -> None:
    """Warped by its displacement the block stands on its floor: pixels of its colour, off-screen."""
    pytest.importorskip("vtkmodules.vtkRenderingOpenGL2", reason=needs_vtk)
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkFiltersGeneral import vtkWarpVector
    from vtkmodules.vtkRenderingCore import (
        vtkActor,
        vtkDataSetMapper,
        vtkRenderer,
        vtkRenderWindow,
        vtkWindowToImageFilter,
    )

    renderer = vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    sc.write(tmp_path / "a.vtu", pressed())
    for name, colour in (("a.vtu", (1, 0, 0)), ("a_obstacles.vtu", (0, 0, 1))):
        grid = grid_of(tmp_path / name)
        grid.GetPointData().SetActiveVectors("displacement")
        warp, mapper, actor = vtkWarpVector(), vtkDataSetMapper(), vtkActor()
        warp.SetInputData(grid)
        warp.SetScaleFactor(20.0)
        mapper.SetInputConnection(warp.GetOutputPort())
        mapper.ScalarVisibilityOff()
        actor.SetMapper(mapper)
        actor.GetProperty().SetColor(*colour)
        actor.GetProperty().LightingOff()
        actor.GetProperty().SetLineWidth(3)
        renderer.AddActor(actor)
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetPosition(0.5, 0.5, 5.0)
    camera.SetFocalPoint(0.5, 0.5, 0.0)
    camera.SetParallelScale(1.0)  # 100 pixels to the unit
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(200, 200)
    window.AddRenderer(renderer)
    window.Render()
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.Update()
    image = vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars()).reshape(200, 200, 3)
    red = np.all(image == (255, 0, 0), axis=2)
    blue = np.all(image == (0, 0, 255), axis=2)
    # a square of 100 by 80 pixels, on a line that is three thick and goes beyond it
    assert red.sum() == pytest.approx(100 * 80, abs=200)
    assert np.flatnonzero(blue.any(axis=1)).mean() == pytest.approx(50 + 20, abs=2)
    assert blue.any(axis=0).sum() > 150
