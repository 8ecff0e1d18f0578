"""Equilibria of finite elements as plain numbers and arrays: parts of a case in which no particle takes part, and which a later
run may take over for as long as nothing that they come from has changed."""
import ast
import dataclasses
import hashlib
import inspect
import sys
import textwrap
import time

import numpy as np


# Parts of a case ------------------------------------------------------------------------------------------

def part(r, name, compute, law, code=(), **numbers):
    """What compute() returns, as a part of the case that stays when only the rest of it or the library changes. What determines
    it: the law, `numbers`, `code` (functions, classes and modules), what is in common to all of them, and the packages."""
    import fem
    import material

    key = {"law": dataclasses.asdict(law), "numbers": numbers, "packages": fem.PACKAGES,
           "code": digest(fem, material, sys.modules[__name__], *code)}
    return r.part(name, compute, key)


def digest(*code):
    """Of sources without comments and docstrings."""
    return hashlib.sha256("".join(map(_bare, code)).encode()).hexdigest()[:16]


def _bare(thing):
    tree = ast.parse(textwrap.dedent(inspect.getsource(thing)))
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node) is not None:
            del node.body[0]
    return ast.dump(tree)


# Followed along the activation ------------------------------------------------------------------------------

def state(body, borders, alpha, seconds):
    """What is compared: displacement at the nodes, end force, pressures over the whole free part and between the `borders` of
    its regions."""
    u = body.points()[1]
    borders = [-np.inf, *borders, np.inf]
    return {"alpha": alpha, "u": u.tolist(), "force": body.end_force()[0], "mean_u": body.mean_displacement(),
            "max_u": float(np.linalg.norm(u, axis=1).max()), "pressure": body.mean_pressure(),
            "regions": [body.mean_pressure(a, b) for a, b in zip(borders, borders[1:])],
            "peak_pressure": float(np.abs(body.cell_pressures()).max()), "J": body.volume_ratio(), "seconds": seconds}


def follow(say, body, levels, borders):
    """Equilibria of a snap.Body at the levels that are reached, for Reference."""
    import fem
    import snap

    began = time.process_time()
    nodes, cells = fem.elements(body)
    states = [state(body, borders, level, time.process_time() - began) for level in snap.climb(body, levels, say)]
    return {"order": body.order, "planes": body.planes, "volume": body.volume, "nodes": nodes.tolist(), "cells": cells.tolist(),
            "states": states, "end": body.end}


class Reference:
    """One mesh and its equilibria: `nodes` (m) and `cells` as fem.elements gives them, `planes` of symmetry (1 is y, 2 is z),
    tetrahedra of the `whole`, `states`, and where they ended or None."""

    def __init__(self, made):
        self.order, self.planes, self.end = made["order"], tuple(made["planes"]), made["end"]
        self.nodes, self.cells = np.array(made["nodes"]), np.array(made["cells"])
        self.whole = 2 ** len(self.planes) * len(self.cells)
        self.states = [{**s, "u": np.array(s["u"])} for s in made["states"]]
        self.kind = "tet4" if self.order == 1 else "tet10"
        # Arrays that went through a file are the mesh that was solved.
        corners = self.nodes[self.cells[:, :4]]
        volume = np.linalg.det(corners[:, 1:] - corners[:, :1]).sum() / 6
        if abs(volume / made["volume"] - 1) > 1e-9 or any(s["u"].shape != self.nodes.shape for s in self.states):
            raise ValueError(f"not the mesh that was solved: {volume} m3 instead of {made['volume']}")

    def at(self, alpha):
        """The state at an activation, or None."""
        return next((s for s in self.states if s["alpha"] == alpha), None)


def judge(references, alpha):
    """(reference, state) of the last quadratic mesh, the finest, that has an equilibrium there, or None."""
    found = [x for x in references if x.order == 2 and x.at(alpha)]
    return (found[-1], found[-1].at(alpha)) if found else None
