"""Static finite elements of the same material: everything that depends on dolfinx's version is in this file.

Written for dolfinx 0.5 (Debian 12). Tetrahedra by gmsh, elements of order 1 or 2, Newton's method with a direct solver
inside pseudo-transient continuation: a drag eta (u - u_before) on every point, lowered as it goes well. Fibres along x.
"""
import logging

import numpy as np
import ufl
from material import Material

try:
    import dolfinx
    import gmsh
    from dolfinx import fem
    from dolfinx.io import gmshio
    from mpi4py import MPI
    from petsc4py import PETSc
except ImportError as error:
    raise ImportError(f"{error}: install python3-dolfinx, gmsh, python3-gmsh and python3-petsc4py") from error

if not dolfinx.__version__.startswith("0.5"):
    raise ImportError(f"dolfinx {dolfinx.__version__}: lib/fem.py knows 0.5 (Debian 12)")


logging.disable(logging.INFO)  # of the form compiler
PACKAGES = {"dolfinx": dolfinx.__version__, "gmsh": gmsh.GMSH_API_VERSION}

# Meshes ---------------------------------------------------------------------------------------------------

def belly_radii(x, length=0.20, width=0.050, thickness=0.036, end=0.006, exponent=1.0, bow=0.0):
    """Half axes in y and z of the belly's section at x = 0 ... length."""
    arch = np.sin(np.pi * np.clip(x / length, 0, 1)) ** exponent
    return end + (width / 2 - end) * arch, end + (thickness / 2 - end) * arch


def belly_centre(x, length=0.20, bow=0.0, **shape):
    """Where the middle of the section at x lies in z."""
    return bow * np.sin(np.pi * np.clip(x / length, 0, 1))


def _mesh(build, size):
    """Meshes what build(occ) makes, with its z axis turned to x (so that sections lie in gmsh's plane). `size` is the
    edge length (m)."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Verbosity", 1)
    gmsh.model.add("body")
    build(gmsh.model.occ)
    gmsh.model.occ.synchronize()
    volumes = gmsh.model.getEntities(3)
    gmsh.model.addPhysicalGroup(3, [v[1] for v in volumes], 1)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.Algorithm3D", 1)
    gmsh.option.setNumber("Mesh.RandomSeed", 1)
    gmsh.model.mesh.generate(3)
    mesh, _, _ = gmshio.model_to_mesh(gmsh.model, MPI.COMM_SELF, 0, gdim=3)
    gmsh.finalize()
    mesh.geometry.x[:] = mesh.geometry.x[:, [2, 0, 1]].copy()
    return mesh


def belly_mesh(size, from_x, to_x, quarter=True, half=False, elongation=1, **shape):
    """The belly between two sections, x = 0 ... length, elements with edges of `size` (m) across and `elongation` times that
    along x. `quarter`: the part with y, z > 0, `half`: with y > 0; cut faces are planes of symmetry.

    Fibres that end at the surface slide past those that end in the held faces: displacement varies fast across the fibres,
    the matrix between them being a hundred times softer, and slowly along them."""
    def build(occ):  # shortened, for meshing in equal edges
        loops = []
        for x in np.linspace(from_x, to_x, 13):
            ry, rz = belly_radii(x, **shape)
            ellipse = occ.addEllipse(0, belly_centre(x, **shape), x / elongation, max(ry, rz * (1 + 1e-9)), rz)
            loops.append(occ.addCurveLoop([ellipse]))
        loft = occ.addThruSections(loops, makeSolid=True)
        if quarter or half:
            below = 0 if quarter else -1
            occ.intersect(loft, [(3, occ.addBox(0, below, from_x / elongation - 1, 1, 1 - below, to_x + 2))])
    mesh = _mesh(build, size)
    mesh.geometry.x[:, 0] *= elongation
    # Straight edges cut corners: swell the sections until the volume is that of the formula.
    x = np.linspace(from_x, to_x, 2001)
    ry, rz = belly_radii(x, **shape)
    exact = np.trapz(np.pi * ry * rz, x) / (4 if quarter else 2 if half else 1)
    one = fem.assemble_scalar(fem.form(fem.Constant(mesh, 1.0) * ufl.Measure("dx", mesh)))
    centre = belly_centre(mesh.geometry.x[:, 0], **shape)
    mesh.geometry.x[:, 1] *= np.sqrt(exact / one)
    mesh.geometry.x[:, 2] = centre + (mesh.geometry.x[:, 2] - centre) * np.sqrt(exact / one)
    return mesh


def box_mesh(length, width, thickness, size, block=0, half=False):
    """A box centred on the x axis, x = 0 ... length, and a `block` that continues it, with faces of elements in between.
    `half`: the part with y > 0."""
    from_y, width = (0, width / 2) if half else (-width / 2, width)

    def build(occ):
        box = occ.addBox(from_y, -thickness / 2, 0, width, thickness, length)
        if block:
            occ.fragment([(3, box)], [(3, occ.addBox(from_y, -thickness / 2, length, width, thickness, block))])
    return _mesh(build, size)


def mesh_of(nodes, cells):
    """A mesh from arrays of nodes and linear tetrahedra."""
    domain = ufl.Mesh(ufl.VectorElement("Lagrange", "tetrahedron", 1))
    return dolfinx.mesh.create_mesh(MPI.COMM_SELF, cells.astype(np.int64), np.ascontiguousarray(nodes), domain)


def elements(body):
    """(nodes, tetrahedra as node numbers) of a body with positive volumes, in the order of most formats: corners, then the
    middles of the edges 12, 23, 31, 14, 24, 34. The nodes are those of body.points()."""
    nodes = body.V.tabulate_dof_coordinates()
    cells = np.array([body.V.dofmap.cell_dofs(c) for c in range(body.cells)])
    if body.order == 2:
        cells = cells[:, [0, 1, 2, 3, 9, 6, 8, 7, 5, 4]]
    x = nodes[cells[:, :4]]
    turned = np.linalg.det(x[:, 1:] - x[:, :1]) < 0
    mirror = [1, 0, 2, 3] if body.order == 1 else [1, 0, 2, 3, 4, 6, 5, 8, 7, 9]
    cells[turned] = cells[turned][:, mirror]
    return nodes, cells


# The body -------------------------------------------------------------------------------------------------

def _stress(u, law, alpha):
    """(energy of the matrix, first Piola-Kirchhoff stress of the fibres)."""
    F = ufl.variable(ufl.Identity(3) + ufl.grad(u))
    C = F.T * F
    J, I1 = ufl.det(F), ufl.tr(C)
    f0 = ufl.as_vector([1.0, 0.0, 0.0])
    a, b = F * f0, C * f0
    I4, I5 = ufl.dot(a, a), ufl.dot(b, b)
    e = (I1 * I4 - I5) / (2 * ufl.sqrt(I4) * J) - 1
    far = ufl.conditional(ufl.gt(e, 0.02), e, 0.02)
    series = e * (2 + e * (-1 / 3 + e * (4 / 45 + e * (-1 / 35 + e * 16 / 1575))))
    angle2 = ufl.conditional(ufl.gt(e, 0.02), ufl.ln(1 + far + ufl.sqrt(far * (2 + far))) ** 2, series)
    matrix = law.G1 * (I5 / I4**2 - 1) + law.G2 * angle2 + 0.5 * law.K * ufl.ln(J) ** 2

    stretch = ufl.sqrt(I4) * (J ** (-1.0 / 3) if law.volume_free else 1)
    r = stretch / law.optimal
    d = ufl.sqrt((r - 1) ** 2 + 1e-12)
    active = ufl.conditional(ufl.lt(d, 0.4), 1 - 4 * d**2, ufl.conditional(ufl.lt(d, 0.6), 9 * (0.6 - d) ** 2, 0.0))
    top = law.linear_from
    growth = law.P1 * (ufl.exp(law.P2 * (r - 1)) - 1)
    end = law.P1 * (np.exp(law.P2 * (top - 1)) - 1)
    slope = law.P1 * law.P2 * np.exp(law.P2 * (top - 1))
    passive = ufl.conditional(ufl.lt(r, 1), 0.0, ufl.conditional(ufl.lt(r, top), growth, end + slope * (r - top)))
    s = law.sigma_max * (alpha * active + passive) * r
    if law.compressive:
        s = s - law.compressive * ufl.conditional(ufl.lt(stretch, 1), 1 - stretch, 0.0)
    along = ufl.outer(a, f0) / I4
    if law.volume_free:
        return matrix, s * (along - ufl.inv(F).T / 3)
    return matrix, J * s * along


class NoSolution(Exception):
    """Newton's method found no equilibrium."""


class Body:
    """A body between two held faces, x = low and x = high; `shift` moves the upper face along x. `quarter`, `half`: what
    of it the mesh is, as in belly_mesh(). `held`: (low, high) where those faces are not the ends of the mesh; what lies
    beyond is held too. `block_from`: no upper face is held, and from this x on the body is a block of stiffness
    `block_Pa`, as good as rigid (with a hundred times as much, rounding hides what is left of a residual)."""

    def __init__(self, mesh, law=None, order=2, quarter=False, half=False, held=None, drag_Pa_per_m2=1e7, block_from=None,
                 block_Pa=1e9):
        self.mesh, self.law, self.order = mesh, law or Material(), order
        self.planes = (1, 2) if quarter else (1,) if half else ()
        self.share = 2 ** len(self.planes)
        self.drag0 = drag_Pa_per_m2
        V = self.V = fem.VectorFunctionSpace(mesh, ("CG", order))
        self.u, self.before = fem.Function(V), fem.Function(V)
        self.alpha = fem.Constant(mesh, 0.0)
        self.drag = fem.Constant(mesh, 0.0)
        self.traction = fem.Constant(mesh, np.zeros(3))
        self.body_force = fem.Constant(mesh, np.zeros(3))
        self.shift = fem.Constant(mesh, np.zeros(3))
        v, du = ufl.TestFunction(V), ufl.TrialFunction(V)
        dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": 4 if order == 2 else 1})
        self.dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": 5})
        matrix, fibres = _stress(self.u, self.law, self.alpha)
        if block_from is not None:
            F = ufl.Identity(3) + ufl.grad(self.u)
            E = (F.T * F - ufl.Identity(3)) / 2
            matrix += ufl.conditional(ufl.gt(ufl.SpatialCoordinate(mesh)[0], block_from), block_Pa, 0.0) * ufl.inner(E, E)
        inner_force = ufl.derivative(matrix * dx, self.u, v) + ufl.inner(fibres, ufl.grad(v)) * dx
        inner_force -= ufl.dot(self.body_force, v) * dx
        residual = inner_force + self.drag * ufl.dot(self.u - self.before, v) * dx
        self._residual = fem.form(residual)
        self._inner = fem.form(inner_force)
        self._tangent = fem.form(ufl.derivative(residual, self.u, du))
        x = mesh.geometry.x[:, 0]
        self.low, self.high = held or (x.min(), x.max())
        near = 1e-6 * (self.high - self.low) + 1e-9
        self.dofs_low = fem.locate_dofs_geometrical(V, lambda p: p[0] < self.low + near)
        self.dofs_high = fem.locate_dofs_geometrical(V, lambda p: p[0] > self.high - near)
        self.bcs = [fem.dirichletbc(np.zeros(3), self.dofs_low, V)]
        if block_from is None:
            self.bcs.append(fem.dirichletbc(self.shift, self.dofs_high, V))
        for d in self.planes:
            facets = dolfinx.mesh.locate_entities_boundary(mesh, 2, lambda p: np.abs(p[d]) < 1e-9)
            dofs = fem.locate_dofs_topological(V.sub(d), 2, facets)
            self.bcs.append(fem.dirichletbc(PETSc.ScalarType(0), dofs, V.sub(d)))
        self.A = fem.petsc.create_matrix(self._tangent)
        self.b = fem.petsc.create_vector(self._residual)
        self.solver = PETSc.KSP().create(MPI.COMM_SELF)
        self.solver.setOperators(self.A)
        self.solver.setType("preonly")
        self.solver.getPC().setType("lu")
        self.solver.getPC().setFactorSolverType("mumps")
        self.solves = 0
        self.cells = mesh.topology.index_map(3).size_local
        self.volume = self.integral(1.0)  # of the mesh

    def integral(self, expression):
        if isinstance(expression, float):
            expression = fem.Constant(self.mesh, expression)
        return fem.assemble_scalar(fem.form(expression * self.dx))

    def _assemble(self):
        with self.b.localForm() as local:
            local.set(0)
        fem.petsc.assemble_vector(self.b, self._residual)
        # Held dofs: what they lack to their value.
        fem.petsc.apply_lifting(self.b, [self._tangent], [self.bcs], [self.u.vector], -1.0)
        fem.petsc.set_bc(self.b, self.bcs, self.u.vector, -1.0)
        return self.b.norm()

    def _newton(self, tolerance, most=12):
        """Norm of the residual (N) reached; raises NoSolution when it does not fall."""
        norm = self._assemble()
        for iteration in range(most):
            if norm < tolerance:
                return norm
            self.A.zeroEntries()
            fem.petsc.assemble_matrix(self.A, self._tangent, self.bcs)
            self.A.assemble()
            step = self.A.createVecLeft()
            self.solver.setOperators(self.A)
            self.solver.solve(self.b, step)
            self.solves += 1
            self.u.vector.axpy(-1, step)
            now = self._assemble()
            if not np.isfinite(now) or (iteration > 2 and now > 100 * norm):
                raise NoSolution(f"residual {now:.3g} N after {iteration + 1} steps")
            norm = now
        if norm < tolerance:
            return norm
        raise NoSolution(f"residual {norm:.3g} N after {most} steps")

    def solve(self, alpha=None, shift=None, tolerance_N=2e-4, most=30, say=None):
        """Equilibrium at an activation and a shift (m; a number is one along x) of the upper face. On NoSolution the state is as before."""
        start = self.u.x.array.copy(), float(self.alpha.value), self.shift.value.copy()
        if alpha is not None:
            self.alpha.value = alpha
        if shift is not None:
            goal = np.array(shift if np.ndim(shift) else [shift, 0, 0], float)
            x = self.V.tabulate_dof_coordinates()[:, 0]  # begin with the body stretched evenly
            even = ((x - self.low) / (self.high - self.low))[:, None] * (goal - self.shift.value)
            self.u.x.array[:] += even.ravel()
            self.shift.value = goal
        drag = self.drag0 if self.solves else 100 * self.drag0  # the first step from rest is the hardest
        try:
            for _ in range(most):
                self.before.x.array[:] = self.u.x.array
                self.drag.value = drag
                try:
                    self._newton(tolerance_N, 6)
                except NoSolution:
                    self.u.x.array[:] = self.before.x.array
                    drag *= 10
                    if drag > 3e10:
                        raise
                    continue
                if say:
                    say(f"P{self.order}, {self.cells} tetrahedra: alpha {float(self.alpha.value):.2f}, "
                        f"drag {drag:.0e}, {self.solves} solves")
                if drag == 0:
                    return self
                drag = drag / 30 if drag > 3e4 else 0.0
            raise NoSolution(f"no rest after {most} steps of the continuation")
        except NoSolution:
            self.u.x.array[:], self.alpha.value, self.shift.value = start
            raise

    # What came out ------------------------------------------------------------------------------------------

    def end_force(self):
        """Tension at the upper face, N: what holds it there."""
        with self.b.localForm() as local:
            local.set(0)
        fem.petsc.assemble_vector(self.b, self._inner)
        force = self.b.array.reshape(-1, 3)
        return self.share * float(force[self.dofs_high, 0].sum()), -self.share * float(
            force[self.dofs_low, 0].sum())

    def end_vector(self):
        """Force that holds the upper face, N."""
        with self.b.localForm() as local:
            local.set(0)
        fem.petsc.assemble_vector(self.b, self._inner)
        return self.share * self.b.array.reshape(-1, 3)[self.dofs_high].sum(0)

    def mean_displacement(self):
        """Volume mean of |u| over the mesh, m."""
        return self.integral(ufl.sqrt(ufl.dot(self.u, self.u) + 1e-24)) / self.volume

    def bulge(self, middle, width):
        """Mean radius about the x axis over its rest value, minus one, in a section of Gaussian weight."""
        X = ufl.SpatialCoordinate(self.mesh)
        weight = ufl.exp(-((X[0] - middle) / width) ** 2)
        now = (X[1] + self.u[1]) ** 2 + (X[2] + self.u[2]) ** 2
        return self.integral(weight * ufl.sqrt(now + 1e-16)) / self.integral(
            weight * ufl.sqrt(X[1] ** 2 + X[2] ** 2 + 1e-16)) - 1

    def _pressure(self):
        """-tr(Cauchy stress)/3, Pa."""
        F = ufl.variable(ufl.Identity(3) + ufl.grad(self.u))
        J = ufl.det(F)
        pressure = -self.law.K * ufl.ln(J) / J
        if not self.law.volume_free:
            _, fibres = _stress(self.u, self.law, self.alpha)
            pressure = pressure - ufl.tr(fibres * (ufl.Identity(3) + ufl.grad(self.u)).T) / (3 * J)
        return pressure

    def mean_pressure(self, from_x=-np.inf, to_x=np.inf):
        """Volume mean of -tr(Cauchy stress)/3 between two rest sections, Pa."""
        x = ufl.SpatialCoordinate(self.mesh)[0]
        inside = ufl.conditional(ufl.And(ufl.gt(x, max(from_x, -1e3)), ufl.lt(x, min(to_x, 1e3))), 1.0, 0.0)
        return self.integral(inside * self._pressure()) / self.integral(inside * 1.0)

    def cell_pressures(self):
        """Pressure amid each tetrahedron, Pa."""
        Q = fem.FunctionSpace(self.mesh, ("DG", 0))
        amid = fem.Function(Q)
        amid.interpolate(fem.Expression(self._pressure(), Q.element.interpolation_points()))
        return amid.x.array.copy()

    def volume_ratio(self):
        return self.integral(ufl.det(ufl.Identity(3) + ufl.grad(self.u))) / self.volume

    def points(self):
        """Rest positions and displacements of the nodes."""
        return self.V.tabulate_dof_coordinates().copy(), self.u.x.array.reshape(-1, 3).copy()
