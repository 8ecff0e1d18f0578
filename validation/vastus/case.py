"""The case `triceps` with the other preset."""
import importlib.util
import pathlib

spec = importlib.util.spec_from_file_location("triceps", pathlib.Path(__file__).parents[1] / "triceps" / "case.py")
triceps = importlib.util.module_from_spec(spec)
spec.loader.exec_module(triceps)

TITLE = "The vastus lateralis against finite elements, the paper's way (solid)"
QUESTION = "The case before, with the preset vastus_lateralis."
QUICK = False


def run(r):
    triceps.run(r, "vastus_lateralis")
