"""What a case hands to the report: criteria, tables, figures, notes."""
import csv
import json
import pathlib
import shutil
import subprocess
import sys
import time

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

plt.rcParams.update({
    "figure.figsize": (6.4, 3.9), "figure.constrained_layout.use": True, "axes.grid": True,
    "grid.alpha": 0.3, "axes.spines.top": False, "axes.spines.right": False, "font.size": 9,
    "lines.linewidth": 1.4, "lines.markersize": 5, "svg.fonttype": "none", "svg.hashsalt": "sph_muscle",
})


def commit(root):
    """The commit of the sources, with a + when they differ from it."""
    run = lambda *a: subprocess.run(["git", "-C", str(root), *a], capture_output=True, text=True).stdout.strip()
    changed = run("status", "--porcelain", "--untracked-files=no")
    written = ("/result/", "/report/", " README.md")  # by a run: in README.md, its table
    relevant = [l for l in changed.splitlines() if not any(w in l for w in written)]
    return (run("rev-parse", "--short=10", "HEAD") or "unknown") + ("+" if relevant else "")


class Result:
    """A case fills one. Everything is written to `folder` at once, so that an interrupted case leaves something."""

    def __init__(self, case, folder, quick, root, go_on=False):
        self.case, self.folder, self.quick, self.root, self.go_on = case, pathlib.Path(folder), quick, root, go_on
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        self.began = time.time()
        self.data = {"case": case, "quick": quick, "commit": commit(root), "criteria": [], "tables": [],
                     "figures": [], "notes": [], "parts": []}
        self._last = 0.0

    def say(self, text):
        """Progress, at most twice a second."""
        if sys.stderr.isatty():
            if time.time() - self._last > 0.5:
                print(f"\r  {time.time() - self.began:6.0f} s  {text[:100]:<100}", end="", file=sys.stderr, flush=True)
                self._last = time.time()
        elif time.time() - self._last > 10:
            print(f"  {time.time() - self.began:6.0f} s  {text}", file=sys.stderr, flush=True)
            self._last = time.time()

    def part(self, name, compute, key=None):
        """What compute() returns (anything JSON can hold), with the notes it made: kept, so that an interrupted run of a long
        case can go on (--continue). `key` holds all that determines it: a part with the same key is taken, whatever commit it
        is of. Without one it must be of this commit, and of sources without changes of their own."""
        path = self.root / "build" / "validation-parts" / self.case / f"{name}.json"
        key = json.loads(json.dumps(key or {"commit": self.data["commit"]}))
        kept = json.loads(path.read_text()) if self.go_on and not self.quick and path.exists() else {}
        if kept.get("key") != key or key.get("commit", "").endswith("+"):
            kept = self._compute(compute, key)
            if not self.quick:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.with_suffix(".new").write_text(json.dumps(kept))
                path.with_suffix(".new").replace(path)  # at once: a run may be interrupted here
        self.data["notes"] += kept["notes"]
        self.data["parts"].append({"name": name, "commit": kept["commit"], "seconds": kept["seconds"]})
        self.save()
        return kept["value"]

    def _compute(self, compute, key):
        before, began = len(self.data["notes"]), time.process_time()
        value = compute()
        made, self.data["notes"][before:] = self.data["notes"][before:], []
        return {"key": key, "commit": self.data["commit"], "seconds": round(time.process_time() - began, 1), "value": value,
                "notes": made}

    def check(self, what, value, below=None, above=None, unit="%"):
        """A criterion: |value| <= below, or value >= above. NaN fails."""
        value = float(value)
        passed = (below is None or abs(value) <= below) and (above is None or value >= above)
        passed = bool(passed and value == value)
        bound = " and ".join(([f"at most {below:g} {unit}"] if below is not None else []) +
                             ([f"at least {above:g} {unit}"] if above is not None else []))
        self.data["criteria"].append({"what": what, "value": value, "bound": bound.strip(), "unit": unit,
                                      "passed": passed})
        print(f"\r  {'ok    ' if passed else 'FAILED'} {what}: {value:.4g} {unit} ({bound.strip()})"
              + " " * 30, file=sys.stderr, flush=True)
        self.save()
        return passed

    def table(self, name, title, columns, rows):
        """A table of the report, kept as a CSV file too; numbers are given four digits in the report only."""
        with open(self.folder / f"{name}.csv", "w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows([[f"{v:.6g}" if isinstance(v, float) else v for v in row] for row in rows])
        shown = [[f"{v:.4g}" if isinstance(v, float) else str(v) for v in row] for row in rows]
        self.data["tables"].append({"name": name, "title": title, "columns": columns, "rows": shown})
        self.save()

    def csv(self, name, columns, rows):
        """Data that the report does not show."""
        with open(self.folder / f"{name}.csv", "w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows([[v if isinstance(v, (str, int)) else f"{v:.6g}" for v in row] for row in rows])

    def figure(self, name, figure, caption):
        figure.savefig(self.folder / f"{name}.svg", metadata={"Date": None}, dpi=130)
        plt.close(figure)
        self.data["figures"].append({"name": name, "caption": caption})
        self.save()

    def note(self, text):
        self.data["notes"].append(text)
        self.save()

    def save(self):
        self.data["seconds"] = round(time.time() - self.began, 1)
        (self.folder / "result.json").write_text(json.dumps(self.data, indent=1) + "\n")
