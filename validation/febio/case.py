"""The finite-element models of belly and presets as FEBio input, checked as far as that goes without FEBio."""
import febio
import numpy as np
import presets
from material import Material

TITLE = "Input files for FEBio"
QUESTION = """The belly and both presets, meshed and held as in the cases belly, triceps and vastus, are written as .feb files
(material "muscle material", linear and quadratic tetrahedra, the fibre law on the volume-free stretch, the only one that FEBio
has) for users of FEBio. Read back, are they the models that were solved here: meshes, held nodes, material law? The forces
by which to compare are those of dolfinx on the same meshes."""

ALPHA = 0.3
BELLY_SIZES = (0.012, 0.008, 0.0055)
PRESET_MESHES = ((1, 5000, 1), (2, 1500, 8), (2, 5000, 8))  # of validation/triceps: order, tetrahedra, longer along x


def models(quick):
    """(name, mesh, order, what of the whole it is) of every model."""
    import fem

    for size in BELLY_SIZES[:1] if quick else BELLY_SIZES:
        for order in (1, 2):
            yield "belly", fem.belly_mesh(size, 0.0424, 0.1576), order, {"quarter": True}
    for name in list(presets.SHAPES)[:1] if quick else presets.SHAPES:
        preset = presets.Preset(name)
        for order, tetrahedra, elongation in PRESET_MESHES[1:2] if quick else PRESET_MESHES:
            yield name, preset.mesh(tetrahedra, preset.section(presets.HELD), elongation), order, {"half": True}


def model(r, name, mesh, order, part):
    """Writes one model; returns its row of the table and what was found wrong, by criterion."""
    import fem
    import snap

    law = Material(volume_free=True)
    body = snap.Body(mesh, law, order, **part)
    list(snap.climb(body, (ALPHA,), r.say))
    if body.end:
        raise fem.NoSolution(f"{name}: {body.end}")
    force, u = body.end_force()[0], body.mean_displacement()
    nodes, cells = fem.elements(body)
    path = r.root / "build" / "febio" / f"{name}_{cells.shape[1]}_{len(cells)}.feb"
    febio.write(path, nodes, cells, law, ALPHA, body.planes,
                f"1/{body.share} of the free part of {name}. dolfinx on this mesh, activation {ALPHA} at rest: end force of the "
                f"whole {force:.3f} N, in size {body.share} times the sum of Rx at the insertion")
    row = [path.name, f"tet{cells.shape[1]}", len(cells), len(nodes), force, 1e3 * u]
    return row, faults(path, body, nodes, law)


def faults(path, body, nodes, law):
    back, cells, sets, fixed, material = febio.read(path)
    volumes = febio.jacobians(back, cells)
    stretch = np.linspace(0.35, 2.2, 1000)
    scale = law.sigma_max
    off = [np.abs(febio.fibre_stress(material, stretch, a) - law.fibre(stretch, a)).max() / scale for a in (0.0, ALPHA, 1.0)]
    x = body.points()[0]
    held = {"origin": len(body.dofs_low), "insertion": len(body.dofs_high)}
    wrong_sets = sum(abs(len(sets[name]) - n) for name, n in held.items())
    cut = {f"symmetry_{'xyz'[k]}": "xyz"[k] for k in body.planes}
    for name, axis in cut.items():
        in_plane = np.abs(x[:, "xyz".index(axis)]) < 1e-8
        wrong_sets += np.sum(~in_plane[sets[name]]) + abs(len(sets[name]) - in_plane.sum())
    wrong_sets += fixed != {"origin": "xyz", "insertion": "xyz", **cut}
    return {"nodes that are missing, superfluous or in no element": abs(len(back) - len(x)) + len(back) - len(
                np.unique(cells)),
            "elements with a determinant below 0": np.sum(volumes <= 0),
            "volume over that of the model, less 1, in millionths": 1e6 * abs(volumes.sum() / body.volume - 1),
            "nodes held wrongly": wrong_sets,
            "fibre law over sigma_max, off by millionths": 1e6 * max(off)}


def run(r):
    rows, found = [], {}
    for one in models(r.quick):
        row, wrong = model(r, *one)
        rows.append(row)
        for what, value in wrong.items():
            found[what] = float(np.maximum(found.get(what, 0), value))  # not a number stays so, and fails
    for what, value in found.items():
        r.check(f"{what}, worst of {len(rows)} files", value, below=1 if "millionths" in what else 0, unit="")
    r.table("models", f"The models, and what dolfinx finds on them at activation {ALPHA}.",
            ["file", "elements", "how many", "nodes", "end force of the whole (N)", "mean displacement of the free part (mm)"],
            rows)
    r.note("The files are written to build/febio. FEBio itself was not run here: what is checked is that a file says what was "
           "solved, with FEBio's documented format and formulas.")
