#!/usr/bin/env python3
"""The structs that the validation reads from the headers are those that the compiler makes of them: a struct that is too
short lets the library write past it.

usage: validation_structs_test.py C-COMPILER
"""
import ctypes
import pathlib
import subprocess
import sys
import tempfile
import types
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
COMPILER = sys.argv.pop(1)
sys.path.insert(0, str(ROOT / "validation" / "lib"))
sys.dont_write_bytecode = True
try:
    import numpy  # noqa: F401
except ImportError:
    sys.modules["numpy"] = types.ModuleType("numpy")  # reading the headers needs none of it
import sphm  # noqa: E402

STRUCTS = {**sphm._STRUCTS, "sphm_parameters": sphm.Parameters, "sphm_context": sphm.Context}


def in_python():
    lines = []
    for name, struct in STRUCTS.items():
        lines.append(f"{name} {ctypes.sizeof(struct)}")
        lines += [f"{name}.{f} {getattr(struct, f).offset} {getattr(struct, f).size}" for f, *_ in struct._fields_]
    return lines


def in_c(folder):
    headers = "".join(f"#include <sph_muscle/{h}.h>\n" for h in ("geometry", "muscle", "parameters", "types"))
    prints = []
    for name, struct in STRUCTS.items():
        prints.append(f'printf("{name} %zu\\n", sizeof({name}));')
        prints += [f'printf("{name}.{f} %zu %zu\\n", offsetof({name}, {f}), sizeof((({name} *)0)->{f}));'
                   for f, *_ in struct._fields_]
    source, program = folder / "structs.c", folder / "structs"
    source.write_text(f"#include <stddef.h>\n#include <stdio.h>\n{headers}int main(void) {{\n" + "\n".join(prints) + "\n}\n")
    subprocess.run([COMPILER, f"-I{ROOT / 'include'}", source, "-o", program], check=True)
    return subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()


class Structs(unittest.TestCase):
    def test_sizes_and_offsets(self):
        self.assertIn("sphm_timing", STRUCTS)
        with tempfile.TemporaryDirectory() as folder:
            self.assertEqual(in_python(), in_c(pathlib.Path(folder)))


if __name__ == "__main__":
    unittest.main()
