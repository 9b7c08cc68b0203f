"""Catmull-Clark subdivision polygon by polygon, with uniform creases: to compare with."""

from __future__ import annotations

import numpy as np

FOREVER = 10.0


class Polygons:
    """A mesh of one step, `sharp` (points) and `crease` (edges, lower point first) by name."""

    def __init__(self, points, faces, crease=None, sharp=None, corners=True):
        self.points = np.array(points, float)
        self.faces = [list(f) for f in faces]
        self.crease = {tuple(sorted(e)): s for e, s in (crease or {}).items()}
        self.sharp = dict(sharp or {})
        self.edges, self.faces_at, self.edges_at = {}, {}, {}
        for k, f in enumerate(self.faces):
            for a, b in zip(f, f[1:] + f[:1], strict=True):
                self.edges.setdefault((min(a, b), max(a, b)), []).append(k)
                self.faces_at.setdefault(a, []).append(k)
        for e in self.edges:
            for p in e:
                self.edges_at.setdefault(p, []).append(e)
        self.crease |= {e: FOREVER for e, used in self.edges.items() if len(used) == 1}
        if corners:
            self.sharp |= {p: FOREVER for p, used in self.faces_at.items() if len(used) == 1}

    def rule(self, p, crease, sharp):
        number = sum(crease.get(e, 0) > 0 for e in self.edges_at[p])
        return "corner" if sharp.get(p, 0) > 0 or number > 2 else "crease" if number == 2 else ""

    def neighbours(self, p, crease=None):
        edges = [e for e in self.edges_at[p] if crease is None or crease.get(e, 0) > 0]
        return self.points[[e[0] + e[1] - p for e in edges]]

    def moved(self, p, rule, crease, middles):
        if rule == "corner":
            return self.points[p]
        if rule == "crease":
            return 0.75 * self.points[p] + 0.125 * self.neighbours(p, crease).sum(0)
        n = len(self.edges_at[p])
        around = self.neighbours(p).sum(0) + middles[self.faces_at[p]].sum(0)
        return (n - 2) / n * self.points[p] + around / n**2

    def step(self):
        """The mesh of the next step; the points of this one come first."""
        middles = np.array([self.points[f].mean(0) for f in self.faces])
        crease = {e: softer(s) for e, s in self.crease.items()}
        sharp = {p: softer(s) for p, s in self.sharp.items()}
        points = []
        for p in range(len(self.points)):
            old, new = self.rule(p, self.crease, self.sharp), self.rule(p, crease, sharp)
            at = self.moved(p, old, self.crease, middles)
            if old != new:
                ending = [self.crease.get(e, 0) for e in self.edges_at[p]]
                ending = [s for s in ending if 0 < s <= 1]
                ending += [s for s in (self.sharp.get(p, 0),) if 0 < s <= 1]
                share = min(float(np.mean(ending)), 1)
                at = share * at + (1 - share) * self.moved(p, new, crease, middles)
            points.append(at)
        number = {}
        for e, used in self.edges.items():
            share, half = min(self.crease.get(e, 0), 1), self.points[list(e)].mean(0)
            smooth = 0.5 * half + 0.5 * middles[used].mean(0)
            number[e] = len(points)
            points.append(share * half + (1 - share) * smooth)
        faces = []
        for k, f in enumerate(self.faces):
            ids = [number[min(a, b), max(a, b)] for a, b in zip(f, f[1:] + f[:1], strict=True)]
            faces += [[f[i], ids[i], len(points) + k, ids[i - 1]] for i in range(len(f))]
        halves = {(p, number[e]): s for e, s in crease.items() if s > 0 for p in e}
        points += list(middles)
        return Polygons(points, faces, halves, {p: s for p, s in sharp.items() if s > 0}, False)

    def limit(self, count):
        """(count, 3) where the first points end up."""
        found = []
        for p in range(count):
            rule = self.rule(p, self.crease, self.sharp)
            if rule == "corner":
                found.append(self.points[p])
            elif rule == "crease":
                around = self.neighbours(p, self.crease).sum(0)
                found.append(self.points[p] * 2 / 3 + around / 6)
            else:
                n = len(self.edges_at[p])
                across = [self.faces[k] for k in self.faces_at[p]]
                opposite = sum(self.points[f[(f.index(p) + 2) % 4]] for f in across)
                around = 4 * self.neighbours(p).sum(0) + opposite
                found.append((n * n * self.points[p] + around) / (n * (n + 5)))
        return np.array(found)

    def normals(self, count):
        """(count, 3) limit normals of the first points [Halstead1993]; NaN beside what is sharp."""
        found = np.full((count, 3), np.nan)
        for p in range(count):
            if self.rule(p, self.crease, self.sharp):
                continue
            after = {}
            for k in self.faces_at[p]:
                f = self.faces[k]
                i = f.index(p)
                after[f[(i + 1) % 4]] = (f[(i + 2) % 4], f[i - 1])
            edge, tangents = next(iter(after)), np.zeros((2, 3))
            n = len(after)
            turn = 2 * np.pi / n
            weight = 1 + np.cos(turn) + np.cos(turn / 2) * np.sqrt(2 * (9 + np.cos(turn)))
            for i in range(n):
                face, following = after[edge]
                for k, shift in enumerate((0, 1)):
                    here, there = np.cos((i - shift) * turn), np.cos((i + 1 - shift) * turn)
                    tangents[k] += weight * here * self.points[edge]
                    tangents[k] += (here + there) * self.points[face]
                edge = following
            cross = np.cross(*tangents)
            found[p] = cross / np.linalg.norm(cross)
        return found


def softer(sharpness):
    return sharpness if sharpness >= FOREVER else max(sharpness - 1, 0)


def limit_of(points, faces, level, deep, **rules):
    """(limit points, limit normals) of the mesh of `level`, from the mesh of `deep`."""
    mesh = Polygons(points, faces, **rules)
    for _ in range(level):
        mesh = mesh.step()
    count = len(mesh.points)
    for _ in range(deep - level):
        mesh = mesh.step()
    return mesh.limit(count), mesh.normals(count)
