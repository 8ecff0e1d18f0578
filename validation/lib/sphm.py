"""The library's C interface from Python, for the validation cases.

The structs are read from include/sph_muscle/*.h when this module is imported, so that they cannot fall out of step
with the library. Arrays come back as copies, by particle id, in double precision.
"""
import ctypes
import os
import pathlib
import re

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
INCLUDE = ROOT / "include" / "sph_muscle"
BUILD = pathlib.Path(os.environ.get("SPH_MUSCLE_BUILD", ROOT / "build" / "validation"))
THREADS = 0  # of every muscle that does not say; 0 is all there are

# Structs from the headers ---------------------------------------------------------------------------------

_SCALARS = {
    "double": ctypes.c_double, "float": ctypes.c_float, "int": ctypes.c_int, "size_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64, "int64_t": ctypes.c_int64, "uint32_t": ctypes.c_uint32,
    "int32_t": ctypes.c_int32, "uint8_t": ctypes.c_uint8, "char": ctypes.c_char,
}
_STRUCTS = {}


def _field(declaration):
    """(name, ctype) of each declarator of "double a, *b, c[3][3]"."""
    words = declaration.replace("const ", " ").strip()
    base, rest = re.match(r"(\w+)\s*(.*)", words, re.S).groups()
    kind = _SCALARS.get(base) or _STRUCTS[base]
    for declarator in rest.split(","):
        stars, name, sizes = re.match(r"\s*(\**)\s*(\w+)\s*((?:\[\w+\])*)\s*$", declarator).groups()
        this = kind
        if stars:
            this = ctypes.POINTER(this)
        for size in reversed(re.findall(r"\[(\w+)\]", sizes)):  # "*b[3]" is three pointers
            this = this * _size(size)
        yield name, this


_ENUMS = {"SPHM_TEXT_SIZE": 1024}


def _size(text):
    return int(text) if text.isdigit() else _ENUMS[text]


def _read_enums(text):
    for body in re.findall(r"enum(?:\s+\w+)?\s*\{(.*?)\}", text, re.S):
        value = 0
        for entry in filter(None, (e.strip() for e in body.split(","))):
            name, _, given = (part.strip() for part in entry.partition("="))
            value = int(given) if given else value
            _ENUMS[name] = value
            value += 1


def _read_structs(path):
    text = re.sub(r"/\*.*?\*/", " ", path.read_text(), flags=re.S)
    _read_enums(text)
    text = re.sub(r"^\s*#.*$", " ", text, flags=re.M)
    for body, name in re.findall(r"typedef struct \w+ \{(.*?)\}\s*(\w+);", text, re.S):
        if name in ("sphm_parameters", "sphm_context", "sphm_parameter_info"):
            continue
        fields = [f for d in body.split(";") if d.strip() for f in _field(d)]
        _STRUCTS[name] = type(name, (ctypes.Structure,), {"_fields_": fields})


class Parameters(ctypes.Structure):
    """sphm_parameters, from the parameter table."""

    @staticmethod
    def fields():
        kinds = {"REAL": ctypes.c_double, "INTEGER": ctypes.c_int64, "BOOLEAN": ctypes.c_int,
                 "CHOICE": ctypes.c_int, "TEXT": ctypes.c_char * 1024, "VECTOR": ctypes.c_double * 3}
        rows = re.findall(r"^(REAL|INTEGER|BOOLEAN|CHOICE|TEXT|VECTOR)\((\w+)",
                          (INCLUDE / "parameter_list.inc").read_text(), re.M)
        return [("marker", ctypes.c_uint32)] + [(name, kinds[kind]) for kind, name in rows]


Parameters._fields_ = Parameters.fields()
for header in ("types.h", "geometry.h", "muscle.h"):
    _read_structs(INCLUDE / header)
CLAMP_DEPTH = float(re.search(r"#define SPHM_CLAMP_DEPTH (\S+)", (INCLUDE / "geometry.h").read_text())[1])  # layers

_LOG = ctypes.CFUNCTYPE(None, ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p)


class Context(ctypes.Structure):
    _fields_ = [("message", ctypes.c_char * 1024), ("log", _LOG), ("user", ctypes.c_void_p)]


class Refused(Exception):
    """A call that did not return SPHM_OK; `status` is negative when the muscle itself failed."""

    def __init__(self, status, message):
        super().__init__(message)
        self.status = status


_library = None


def library():
    global _library
    if _library is None:
        _library = ctypes.CDLL(str(BUILD / "libsph_muscle.so"))
        _library.sphm_parameters_default.restype = Parameters
        _library.sphm_muscle_time.restype = ctypes.c_double
        _library.sphm_muscle_time_step.restype = ctypes.c_double
        _library.sphm_muscle_steps.restype = ctypes.c_uint64
        _library.sphm_muscle_body.restype = ctypes.POINTER(_STRUCTS["sphm_body"])
        _library.sphm_muscle_timing.restype = _STRUCTS["sphm_timing"]
        _library.sphm_muscle_time_step_limits.restype = _STRUCTS["sphm_time_step_limits"]
        _library.sphm_version.restype = ctypes.c_char_p
        _library.sphm_build_configuration.restype = ctypes.c_char_p
        if ctypes.sizeof(ctypes.c_float) != 4 or b"double" in _library.sphm_build_configuration():
            raise RuntimeError("the validation reads a library of single precision")
    return _library


def build_configuration():
    return library().sphm_build_configuration().decode()


def _array(pointer, count, width=1):
    flat = np.ctypeslib.as_array(pointer, (count * width,)).astype(
        float if pointer._type_ in (ctypes.c_float, ctypes.c_double) else int)
    return flat.reshape(count, width) if width > 1 else flat


def _surface(given):
    """sphm_surface of (vertices, triangles), which the library copies; None stays None."""
    if given is None:
        return None
    vertices, triangles = np.ascontiguousarray(given[0], float), np.ascontiguousarray(given[1], np.int32)
    surface = _STRUCTS["sphm_surface"](len(vertices), len(triangles))
    surface.vertices = vertices.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
    surface.triangles = triangles.ctypes.data_as(ctypes.POINTER(ctypes.c_int32))
    surface.kept = vertices, triangles
    return ctypes.byref(surface)


# The muscle -----------------------------------------------------------------------------------------------

ORIGIN, INSERTION = 0, 1


def default(name):
    """What the library gives a parameter. Muscle() here has another passive_compressive_stiffness."""
    return getattr(library().sphm_parameters_default(), name)


class Muscle:
    """One muscle. Parameters by the names of the README; text and numbers are both taken. `surface`: (vertices in m,
    triangles) to fill instead of the preset."""

    def __init__(self, surface=None, **parameters):
        self.notes = []
        self._log = _LOG(lambda level, text, user: self.notes.append(text.decode()))
        self._context = Context(b"", self._log, None)
        self._handle = ctypes.c_void_p()
        self.parameters = library().sphm_parameters_default()
        parameters.setdefault("threads", THREADS)
        parameters.setdefault("passive_compressive_stiffness", 0)  # Table 3 alone, as the references have it
        for name, value in parameters.items():
            text = str(value).lower() if isinstance(value, bool) else repr(float(value)) if isinstance(
                value, (float, np.floating)) else str(value)
            self._do("sphm_parameters_set", ctypes.byref(self.parameters), name.encode(), text.encode())
        self._do("sphm_muscle_create", ctypes.byref(self.parameters), _surface(surface), ctypes.byref(self._handle))
        body = library().sphm_muscle_body(self._handle).contents
        self.count = body.count
        self.spacing, self.support, self.volume = body.spacing_m, body.support_radius_m, body.volume_m3
        self.layer, self.length, self.mid_radius = body.layer_m, body.length_m, body.mid_radius_m
        self.sections = np.array(body.clamp_m)  # x . axis
        self.origin, self.insertion = np.array(body.origin_m), np.array(body.insertion_m)
        self.rest = _array(body.positions, self.count, 3)
        self.volumes = _array(body.volumes, self.count)
        self.fibres = _array(body.fibres, self.count, 3)
        self.axial_fraction = _array(body.axial_fraction, self.count)
        self.attachment = _array(body.attachment, self.count)
        self.region = _array(body.region, self.count)
        self.outer = _array(body.outer, self.count)
        self.isolated = body.isolated

    def __del__(self):
        if getattr(self, "_handle", None):
            library().sphm_muscle_destroy(self._handle)

    def _do(self, function, *arguments):
        self._context.message = b""
        status = getattr(library(), function)(*arguments, ctypes.byref(self._context))
        if status:
            raise Refused(status, self._context.message.decode())

    @property
    def time(self):
        return library().sphm_muscle_time(self._handle)

    @property
    def time_step(self):
        return library().sphm_muscle_time_step(self._handle)

    @property
    def steps(self):
        return library().sphm_muscle_steps(self._handle)

    def advance(self, seconds):
        self._do("sphm_muscle_advance", self._handle, ctypes.c_double(seconds))

    def step(self, count):
        self._do("sphm_muscle_step", self._handle, ctypes.c_size_t(count))

    def activate(self, activation, seconds=0.0):
        self._do("sphm_muscle_activate", self._handle, ctypes.c_double(activation), ctypes.c_double(seconds))

    def stimulate(self, electrode, current, seconds=0.0):
        self._do("sphm_muscle_stimulate", self._handle, electrode.encode(), ctypes.c_double(current),
                 ctypes.c_double(seconds))

    def schedule(self, text):
        self._do("sphm_muscle_schedule", self._handle, text.encode())

    def end_pose(self, end):
        pose = _STRUCTS["sphm_end_pose"]()
        self._do("sphm_muscle_end_pose", self._handle, end, ctypes.byref(pose))
        return pose

    def move_end(self, end, by, seconds, velocity=(0, 0, 0)):
        """Moves an end by a vector (m) from where it is within `seconds`, arriving with `velocity` (m/s)."""
        pose = self.end_pose(end)
        for d in range(3):
            pose.position_m[d] += by[d]
            pose.velocity_m_per_s[d] = velocity[d]
            pose.angular_velocity_rad_per_s[d] = 0
        self._do("sphm_muscle_set_end_pose", self._handle, end, ctypes.byref(pose), ctypes.c_double(seconds))

    def slide_end(self, end, load_N=0.0):
        """Lets an end slide along the line of action, pulled away from the belly by a load."""
        self._do("sphm_muscle_slide_end", self._handle, end, ctypes.c_double(load_N))

    def release_end(self, end):
        self._do("sphm_muscle_release_end", self._handle, end)

    def wrench(self, end):
        """Force and its parts (N) on the bone at an end, as a dict of arrays."""
        w = _STRUCTS["sphm_wrench"]()
        self._do("sphm_muscle_wrench", self._handle, end, ctypes.byref(w))
        return {name: np.array(getattr(w, name)) for name, _ in w._fields_}

    def pull(self):
        """Tension at the insertion (N), positive when the muscle pulls."""
        return -self.wrench(INSERTION)["force_N"][0]

    def clamps(self):
        """Where the tissue of a solid along x behaves as if it were clamped: some way behind the last held layers."""
        x, depth = self.rest[:, 0], CLAMP_DEPTH * self.layer
        return x[self.attachment == 1].max() - depth, x[self.attachment == 2].min() + depth

    def particles(self):
        p = _STRUCTS["sphm_particles"]()
        self._do("sphm_muscle_particles", self._handle, ctypes.byref(p))
        wide = ("position_m", "velocity_m_per_s", "displacement_vector_m")
        return {name: _array(getattr(p, name), p.count, 3 if name in wide else 1)
                for name, _ in p._fields_ if name != "count"}

    def observe(self):
        o = _STRUCTS["sphm_observation"]()
        self._do("sphm_muscle_observe", self._handle, ctypes.byref(o))
        return o

    def timing(self):
        return library().sphm_muscle_timing(self._handle)

    def limits(self):
        return library().sphm_muscle_time_step_limits(self._handle)


def held_at(plane, **parameters):
    """A muscle along x, symmetric about its middle, whose ends are clamped in x = -plane and x = plane. The library clamps a
    solid in the section that cuts attachment_fraction off, and a bar, whose layers come from its sides, at the border of
    layers that is nearest to it. So the share is improved until the sections lie there, by the volume of a layer."""
    if parameters.get("tissue") != "solid":
        return _held_by_layers(plane, **parameters)
    m = Muscle(**parameters)
    for _ in range(8):
        off = np.array((-1, 1)) * m.sections - plane
        if np.abs(off).max() < 2e-3 * m.layer:
            break
        layer = np.maximum(0, 1 - np.abs(np.abs(m.rest[:, 0]) - plane) / m.layer).mean() / 2
        share = m.parameters.attachment_fraction + layer * off.mean() / m.layer
        m = Muscle(**{**parameters, "attachment_fraction": float(np.clip(share, 1e-3, 0.45))})
    off = np.array((-1, 1)) * m.clamps() - plane
    if np.abs(off).max() > (0.51 if parameters.get("preset") == "bar" else 0.01) * m.layer:
        raise ValueError(f"clamps at {m.clamps()} m instead of {plane} m")
    return m


def _held_by_layers(plane, **parameters):
    """The fluid, which is held by whole layers: the last one is that nearest to the plane."""
    m = Muscle(**parameters)
    shares = []
    for inward, share in ((m.rest[:, 0], m.axial_fraction), (-m.rest[:, 0], 1 - m.axial_fraction)):
        layers = np.unique(np.round(inward, 8))
        last = layers[np.argmin(np.abs(layers + plane))]
        shares.append(share[np.abs(inward - last) < 1e-7].mean())
    return Muscle(**{**parameters, "attachment_fraction": float(max(shares)) + 1e-4})


def settle(muscle, seconds, tolerance=1e-3, slice_s=0.01, least=0.05, say=None):
    """Advances until the end force changes by less than `tolerance` of itself in each of three slices in a row; returns
    the last change. The time limit is `seconds`."""
    before, still, change = muscle.pull(), 0, np.inf
    start = muscle.time
    while muscle.time - start < seconds - 1e-9 and still < 3:
        muscle.advance(slice_s)
        now = muscle.pull()
        change = abs(now - before) / max(abs(now), 1e-6)
        still = still + 1 if change < tolerance and muscle.time - start > least else 0
        before = now
        if say:
            say(f"t {muscle.time:.2f} s, {now:.2f} N")
    return change
