"""validation/run, once the packages are there and the library is built. See validation/README.md."""
import argparse
import importlib.util
import pathlib
import platform
import sys
import time
import traceback

HERE = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(HERE / "lib"))
import report  # noqa: E402
import result as results  # noqa: E402
import sphm  # noqa: E402

ROOT = HERE.parent
# In the order of the report.
CASES = ["plane_wave", "activation_times", "fibre_bar", "force_velocity", "block", "cantilever", "belly", "isotonic", "triceps",
         "triceps_volume_free", "vastus", "muscles_fluid", "real_muscles", "febio", "physiology", "paper_stability", "speed"]


def load(name):
    spec = importlib.util.spec_from_file_location(name, HERE / name / "case.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.NAME = name
    return module


def run_case(case, folder, quick, go_on):
    """Whether every criterion holds. A case that dies is a failed one, and says why."""
    print(f"== {case.NAME}: {case.TITLE}", file=sys.stderr, flush=True)
    r = results.Result(case.NAME, folder, quick, ROOT, go_on)
    try:
        case.run(r)
    except Exception as error:  # the other cases go on
        traceback.print_exc()
        r.note(f"The case ended with {type(error).__name__}: {error}")
        r.check("the case runs to its end", 0, above=1, unit="")
    r.save()
    held, total = report.verdict(r.data)
    print(f"   {held} of {total} criteria hold, {time.time() - r.began:.0f} s", file=sys.stderr, flush=True)
    return held == total > 0


def main():
    parser = argparse.ArgumentParser(prog="validation/run", description="How right is this muscle?")
    parser.add_argument("cases", nargs="*", metavar="CASE", help="only these; all by default: " + ", ".join(CASES))
    parser.add_argument("--quick", action="store_true", help="coarse, in minutes; results go to build/validation-quick")
    parser.add_argument("--continue", dest="go_on", action="store_true",
                        help="take the parts of long cases that earlier runs finished, and that would come out the same, from "
                             "build/validation-parts")
    parser.add_argument("--report", action="store_true", help="run nothing: write the report of the results that are kept")
    parser.add_argument("--threads", type=int, default=0, help="of the muscle; 0 (default): all there are")
    options = parser.parse_args()
    unknown = [c for c in options.cases if c not in CASES]
    if unknown:
        parser.error(f"no case is called {unknown[0]}; there are {', '.join(CASES)}")
    sphm.THREADS = options.threads
    cases = [load(name) for name in CASES]
    store = ROOT / "build" / "validation-quick"
    folder_of = (lambda c: store / c.NAME) if options.quick else (lambda c: HERE / c.NAME / "result")
    target = store / "report" if options.quick else HERE / "report"
    chosen = [c for c in cases if not options.cases or c.NAME in options.cases]
    if options.quick:
        chosen = [c for c in chosen if getattr(c, "QUICK", True)]
    chosen = [c for c in chosen if c.NAME in options.cases or getattr(c, "available", lambda: True)()]
    passed = [run_case(c, folder_of(c), options.quick, options.go_on) for c in chosen if not options.report]
    shown = cases if not options.quick else chosen
    summary = report.write(shown, folder_of, target, options.quick,
                 f"Library: {sphm.build_configuration()}; {platform.machine()}.")
    if not options.quick:
        report.quote(ROOT / "README.md", summary)
    print(f"{sum(passed)} of {len(passed)} cases hold; report: {target / 'index.html'}")
    return 0 if options.report or (passed and all(passed)) else 1


if __name__ == "__main__":
    sys.exit(main())
