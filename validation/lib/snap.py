"""Equilibria of finite elements past snaps: thin strips, whose fibres end at the surface, jump past the clamps at some
activations, of real muscles and of fine meshes of the belly, where fem.Body.solve() finds nothing."""
import fem
import numpy as np

STILL = 1e-7  # m; in a step with drag


class Body(fem.Body):
    """Whose drag falls the faster the better it goes: a snap asks for many short steps, and what follows it for none."""

    most_solves = 500  # of a linear system, over all levels; the belly's finest mesh takes 387

    def tired(self):
        return self.solves >= self.most_solves

    def solve(self, alpha, tolerance_N=2e-4, say=None):
        """Equilibrium at an activation. On NoSolution the state is as before."""
        start = self.u.x.array.copy(), float(self.alpha.value)
        self.alpha.value = alpha
        drag, fall = (self.drag0 if self.solves else 100 * self.drag0), 30.0
        try:
            while drag < 3e11 and not self.tired():
                self.before.x.array[:] = self.u.x.array
                self.drag.value = drag
                try:
                    self._newton(tolerance_N, 8)
                except fem.NoSolution:
                    self.u.x.array[:] = self.before.x.array
                    drag, fall = max(4 * drag, 1e6), 2.0
                    continue
                if say:
                    say(f"{self.cells} tetrahedra: alpha {alpha:.2f}, drag {drag:.0e}, {self.solves} solves")
                if drag == 0:
                    return self
                still = np.abs(self.u.x.array - self.before.x.array).max() < STILL
                drag, fall = drag / fall, min(1.5 * fall, 30.0)
                drag = 0.0 if still or drag < 3e4 else drag
            raise fem.NoSolution(f"not after {self.solves} solves, drag {drag:.0e}")
        except fem.NoSolution:
            self.u.x.array[:], self.alpha.value = start
            raise


def climb(body, levels, say):
    """Yields the levels of activation that are reached, one after the other, with the body in equilibrium. After the last one
    body.end is None, or says where it ended."""
    body.end, now, step = None, 0.0, 0.05
    for level in levels:
        while now < level - 1e-9:
            goal = level if now + 1.01 * step > level else now + step
            try:
                body.solve(goal, say=say)
            except fem.NoSolution as end:
                step = (goal - now) / 2
                if step < 0.01 or body.tired():
                    body.end = f"order {body.order}, {body.share * body.cells} tetrahedra: none above {now:.3f} ({end})"
                    return
                continue
            now, step = goal, 0.1
        yield level
