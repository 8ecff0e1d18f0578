"""The case `triceps` with the fibre law on the volume-free stretch."""
import importlib.util
import pathlib

spec = importlib.util.spec_from_file_location("triceps", pathlib.Path(__file__).parents[1] / "triceps" / "case.py")
triceps = importlib.util.module_from_spec(spec)
spec.loader.exec_module(triceps)

TITLE = "The triceps against finite elements: the law on the volume-free stretch"
QUESTION = "The case before, with the fibre term on the volume-free stretch, as Blemker and Delp, and FEBio, have it."
QUICK = False


def run(r):
    triceps.run(r, coupling="volume_free")
