"""The finite-element models as input files for FEBio (.feb, format 4.0), and the same read back.

Material `muscle material` (Blemker's law) as FEBio's manual gives it; what differs from the library's parameters:
  lam_max   the stretch from which the passive curve is straight, not relative to Lofl: 1.4 Lofl here
  k         pressure model "default": p = k ln(J)/J
The fibre law acts on the volume-free stretch, so that only `fibre_coupling: volume_free` can be written.
Nodes of a ten-node tetrahedron: its corners 1-4, then the middles of 12, 23, 31, 14, 24, 34.
"""
import xml.etree.ElementTree as xml

import numpy as np

DENSITY = 1112.0
MIDDLES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))  # of the nodes 5 ... 10
STEP_S, RAMP_S, HOLD_S, END_S = 1e-3, 0.2, 0.25, 0.5  # 250 steps up, 250 down and after


def _add(parent, tag, text=None, /, **attributes):
    node = xml.SubElement(parent, tag, {k: str(v) for k, v in attributes.items()})
    if text is not None:
        node.text = text if isinstance(text, str) else f"{text:.12g}"
    return node


def _list(values):
    return ",".join(f"{v:.9g}" for v in values)


def _control(root):
    """Implicit dynamics; rhoi 0 damps what the steps do not resolve."""
    control = _add(root, "Control")
    _add(control, "analysis", "DYNAMIC")
    _add(control, "time_steps", round(END_S / STEP_S))
    _add(control, "step_size", STEP_S)
    stepper = _add(control, "time_stepper", type="default")
    for name, value in (("max_retries", 10), ("opt_iter", 15), ("dtmin", STEP_S / 100), ("dtmax", STEP_S)):
        _add(stepper, name, value)
    solver = _add(control, "solver", type="solid")
    for name, value in (("symmetric_stiffness", "symmetric"), ("max_refs", 25), ("dtol", 1e-4), ("etol", 1e-3),
                        ("rtol", 0), ("rhoi", 0)):
        _add(solver, name, value)
    _add(_add(solver, "qn_method", type="BFGS"), "max_ups", 0)  # full Newton


def _material(root, law, alpha):
    if not law.volume_free:
        raise ValueError("FEBio's muscle material knows the volume-free stretch only: Material(volume_free=True)")
    if law.compressive:
        raise ValueError("FEBio's muscle material has no compressive fibre stiffness")
    material = _add(_add(root, "Material"), "material", id=1, name="muscle", type="muscle material")
    for name, value in (("density", DENSITY), ("k", law.K), ("pressure_model", "default"), ("g1", law.G1), ("g2", law.G2),
                        ("p1", law.P1), ("p2", law.P2), ("Lofl", law.optimal), ("smax", law.sigma_max),
                        ("lam_max", law.linear_from * law.optimal)):
        _add(material, name, value)
    _add(material, "activation", alpha, lc=1)
    _add(_add(material, "fiber", type="vector"), "vector", "1,0,0")


def _mesh(root, nodes, cells, sets):
    mesh = _add(root, "Mesh")
    block = _add(mesh, "Nodes", name="nodes")
    for k, x in enumerate(nodes):
        _add(block, "node", _list(x), id=k + 1)
    block = _add(mesh, "Elements", type=f"tet{cells.shape[1]}", name="free_part")
    for k, cell in enumerate(cells):
        _add(block, "elem", _list(cell + 1), id=k + 1)
    for name, members in sets.items():
        _add(mesh, "NodeSet", _list(members + 1), name=name)
    _add(_add(root, "MeshDomains"), "SolidDomain", name="free_part", mat="muscle")


def _boundary(root, sets):
    boundary = _add(root, "Boundary")
    for name in sets:
        fixed = {"symmetry_y": "y", "symmetry_z": "z"}.get(name, "xyz")
        condition = _add(boundary, "bc", name=name, node_set=name, type="zero displacement")
        for axis in "xyz":
            _add(condition, f"{axis}_dof", int(axis in fixed))


def _activation_curve(root):
    curve = _add(_add(root, "LoadData"), "load_controller", id=1, name="activation", type="loadcurve")
    _add(curve, "interpolate", "LINEAR")
    _add(curve, "extend", "CONSTANT")
    points = _add(curve, "points")
    for t, value in ((0, 0), (RAMP_S, 1), (HOLD_S, 1), (HOLD_S + 0.05, 0)):
        _add(points, "pt", _list((t, value)))


def _output(root, stem):
    output = _add(root, "Output")
    plot = _add(output, "plotfile", type="febio")
    for name in ("displacement", "stress", "relative volume", "reaction forces"):
        _add(plot, "var", type=name)
    log = _add(output, "logfile")
    _add(log, "node_data", data="Rx;Ry;Rz", node_set="insertion", delim=",", file=f"{stem}_insertion_force.csv",
         name="reaction forces at the insertion (N); sum Rx over the nodes")
    _add(log, "node_data", data="ux;uy;uz", delim=",", file=f"{stem}_displacement.csv", name="displacement (m)")
    _add(log, "element_data", data="sx;sy;sz;J", delim=",", file=f"{stem}_stress.csv", name="Cauchy stress (Pa) and J")


def write(path, nodes, cells, law, alpha, planes=(), comment=""):
    """A body between two held faces, its least and largest x; `planes`: axes (1 is y, 2 is z) that are normal to a plane
    of symmetry through 0."""
    near = 1e-6 * np.ptp(nodes[:, 0])
    sets = {"origin": np.nonzero(nodes[:, 0] < nodes[:, 0].min() + near)[0],
            "insertion": np.nonzero(nodes[:, 0] > nodes[:, 0].max() - near)[0]}
    for axis in planes:
        sets[f"symmetry_{'xyz'[axis]}"] = np.nonzero(np.abs(nodes[:, axis]) < 1e-8)[0]
    root = xml.Element("febio_spec", version="4.0")
    root.append(xml.Comment(f" {comment} "))
    _add(root, "Module", type="solid")
    _control(root)
    _material(root, law, alpha)
    _mesh(root, nodes, cells, sets)
    _boundary(root, sets)
    _activation_curve(root)
    _output(root, path.stem)
    xml.indent(root)
    path.parent.mkdir(parents=True, exist_ok=True)
    xml.ElementTree(root).write(path, encoding="UTF-8", xml_declaration=True)


# Read back --------------------------------------------------------------------------------------------------

def _numbers(text, kind=float):
    return [kind(v) for v in text.split(",")]


def read(path):
    """(nodes, cells from 0, node sets, fixed axes by set, material's numbers) of a file; ids must count from 1."""
    root = xml.parse(path).getroot()
    nodes = root.findall("Mesh/Nodes/node")
    cells = root.findall("Mesh/Elements/elem")
    for found in (nodes, cells):
        if [int(e.get("id")) for e in found] != list(range(1, len(found) + 1)):
            raise ValueError(f"{path}: ids do not count from 1")
    sets = {s.get("name"): np.array(_numbers(s.text, int)) - 1 for s in root.findall("Mesh/NodeSet")}
    fixed = {c.get("node_set"): "".join(a for a in "xyz" if c.findtext(f"{a}_dof") == "1")
             for c in root.findall("Boundary/bc")}
    material = {e.tag: float(e.text) for e in root.find("Material/material") if e.tag not in ("fiber", "pressure_model")}
    return (np.array([_numbers(n.text) for n in nodes]), np.array([_numbers(c.text, int) for c in cells]) - 1, sets, fixed,
            material)


def fibre_stress(material, stretch, alpha):
    """Cauchy stress along the fibre at J = 1 as the manual has it (its F_m), from the numbers in a file."""
    lofl, p1, p2, top = (material[k] for k in ("Lofl", "p1", "p2", "lam_max"))
    r = np.asarray(stretch) / lofl
    p3 = p1 * p2 * np.exp(p2 * (top / lofl - 1))
    p4 = p1 * (np.exp(p2 * (top / lofl - 1)) - 1) - p3 * top / lofl
    passive = np.select([stretch <= lofl, stretch < top], [0 * r, p1 * (np.exp(p2 * (r - 1)) - 1)], p3 * r + p4)
    active = np.select([(r <= 0.4) | (r >= 1.6), r <= 0.6, r >= 1.4], [0 * r, 9 * (r - 0.4) ** 2, 9 * (r - 1.6) ** 2],
                       1 - 4 * (1 - r) ** 2)
    return material["smax"] * (passive + alpha * active) * r


def jacobians(nodes, cells):
    """Determinant of the map of each tetrahedron at its corners, the least one over six: for straight edges the volume."""
    x = nodes[cells]
    if cells.shape[1] == 4:
        return np.linalg.det(np.stack([x[:, k] - x[:, 0] for k in (1, 2, 3)], 2)) / 6
    least = np.full(len(cells), np.inf)
    for corner in np.vstack([np.zeros(3), np.eye(3)]):
        barycentric = np.r_[1 - corner.sum(), corner]
        slope = np.vstack([-np.ones(3), np.eye(3)])  # of the barycentric coordinates
        shapes = [(4 * barycentric[k] - 1) * slope[k] for k in range(4)]
        shapes += [4 * (barycentric[a] * slope[b] + barycentric[b] * slope[a]) for a, b in MIDDLES]
        least = np.minimum(least, np.linalg.det(np.einsum("cnd,ne->cde", x, np.array(shapes))) / 6)
    return least
