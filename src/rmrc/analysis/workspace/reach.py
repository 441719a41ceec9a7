"""A workspace: reached cells, their postures, and the curves that bound them."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.factors import Rule
from rmrc.analysis.survey import Survey
from rmrc.analysis.workspace.extents import Extent
from rmrc.analysis.workspace.slices import Slice
from rmrc.law.task import Array, Task
from rmrc.support.brief import brief

Measure = Literal["sigma_min", "manipulability", "condition"]
MEASURES: tuple[Measure, ...] = ("sigma_min", "manipulability", "condition")


@dataclass(frozen=True)
class Curve:
    """A curve of the slice, and its configurations.

    Attributes:
        label: `singular`, or the limit that is reached: `NAME lower`, `NAME upper`.
        q: (k, n) [rad or m].
        points: Points in the slice, (k, 2) [m].
        within: Which of them are within the joint limits, (k,).
        family: Number of the family of singularities of each, (k,); None if no families are known.
    """

    label: str
    q: Array
    points: Array
    within: NDArray[np.bool_]
    family: NDArray[np.intp] | None = None


@dataclass(frozen=True)
class Reach:
    """The cells that the site can reach, with or without joint limits.

    Attributes:
        size: Side of a cell [m].
        reached: (A, B).
        postures: Number of postures that bring the site to the middle of a cell, (A, B); -1 if the arm has
            infinitely many, or the slice is not a surface.
        values: σ_min, w and κ of the best, or the worst, of the postures found, each (A, B); nan elsewhere.
        q: The posture of the best, or the worst, σ_min, (A, B, n); nan elsewhere.
        extents: Extents of both coordinates; none if nothing is reached.
        ends: Smallest and largest σ_min, w and κ of all points; none if nothing is reached.
        source: Source of the worse end of each: `singular`, `limits`, or `cells`.
    """

    size: float
    reached: NDArray[np.bool_]
    postures: NDArray[np.int64]
    values: dict[Measure, Array]
    q: Array
    extents: tuple[Extent, ...] = ()
    ends: dict[Measure, tuple[float, float]] = field(default_factory=dict)
    source: dict[Measure, str] = field(default_factory=dict)

    @property
    def area(self) -> float:
        """Area of all reached cells [m²]."""
        return float(self.reached.sum()) * self.size**2

    @property
    def accuracy(self) -> float:
        """Largest error of the area [m²]: half a cell wherever two neighbors differ.

        For samples it is a whole cell, as a cell counts that is reached in a corner only.
        """
        padded = np.pad(self.reached, 1)
        borders = (padded[1:] != padded[:-1]).sum() + (padded[:, 1:] != padded[:, :-1]).sum()
        return float(borders) * (1.0 if (self.postures < 0).any() else 0.5) * self.size**2


@brief
@dataclass(frozen=True)
class Workspace:
    """The result of `workspace`.

    Attributes:
        task: The arm, and the rows whose singular values were taken.
        part: The slice.
        a: Edges of the cells along the first coordinate, (A + 1,) [m].
        b: Along the second, (B + 1,) [m].
        free: Without joint limits: each hinge turns fully; slides keep theirs.
        limited: With them.
        singular: Singular curves, on a surface; otherwise one "curve" of points without an order.
        families: Families of singularities, one for each factor of det J_v; none if no factors are known.
        limits: Curves where a joint limit bounds the reached set, by limit, on a surface; otherwise points.
        home: The configuration of the drawn arm, (n,).
        links: Points of the drawn arm in the slice, (k, 2) [m].
        worst: Whether `values` are of the worst posture instead of the best.
        samples: Number of examined configurations.
    """

    task: Task
    part: Slice
    a: Array
    b: Array
    free: Reach
    limited: Reach
    singular: tuple[Curve, ...]
    families: tuple[Rule, ...]
    limits: tuple[Curve, ...]
    home: Array
    links: Array
    worst: bool
    samples: int

    def names(self, curve: Curve) -> NDArray[np.str_]:
        """Return the name of the family of each configuration of a singular curve, (k,)."""
        if curve.family is None:
            return np.full(len(curve.q), "")
        return np.array([rule.name for rule in self.families])[curve.family]

    def volume(self, reach: Reach) -> float | None:
        """Return the volume that a slice about the first axis sweeps, 2π ∫ r dA [m³]; None for a plane."""
        if not self.part.is_round:
            return None
        r = 0.5 * (self.a[1:] + self.a[:-1])
        return float(2.0 * np.pi * (reach.reached.sum(axis=1) @ r) * reach.size**2)


@dataclass
class Found:
    """The best, or the worst, of the results in each cell."""

    task: Task
    shape: tuple[int, int]
    worst: bool
    values: dict[Measure, Array] = field(init=False)
    q: Array = field(init=False)
    count: NDArray[np.int64] = field(init=False)
    seen: int = 0

    def __post_init__(self) -> None:  # noqa: D105
        cells = self.shape[0] * self.shape[1]
        self.values = {measure: np.full(cells, np.nan) for measure in MEASURES}
        self.q = np.full((cells, self.task.arm.n), np.nan)
        self.count = np.zeros(cells, np.int64)

    def add(self, cells: NDArray[np.int64], found: Survey) -> None:
        """Add the results at configurations, each of which belongs to a cell."""
        self.seen += len(cells)
        self.count += np.bincount(cells, minlength=len(self.count))
        of = {
            "sigma_min": found.sigma[:, -1],
            "manipulability": found.manipulability,
            "condition": found.condition,
        }
        for measure in MEASURES:
            high = (measure == "condition") == self.worst
            key = of[measure] if high else -of[measure]
            # Of equal indices, the last one assigned stays.
            order = np.argsort(key, kind="stable")
            best = np.full(len(self.count), -1)
            best[cells[order]] = order
            hit = np.flatnonzero(best >= 0)
            self._keep(measure, hit, of[measure][best[hit]], found.q[best[hit]])

    def include(self, other: "Found") -> None:
        """Add the results of another object."""
        self.count += other.count
        hit = np.flatnonzero(other.count)
        for measure in MEASURES:
            self._keep(measure, hit, other.values[measure][hit], other.q[hit])

    def _keep(self, measure: Measure, cells: NDArray[np.int64], new: Array, q: Array) -> None:
        """Store the value of each of some cells, all different, if it is better than the earlier results."""
        old = self.values[measure][cells]
        high = (measure == "condition") == self.worst
        better = np.isnan(old) | ((new > old) if high else (new < old))
        self.values[measure][cells[better]] = new[better]
        if measure == "sigma_min":
            self.q[cells[better]] = q[better]

    def reach(self, size: float, postures: bool) -> Reach:
        """Return all of it as maps."""
        counted = self.count if postures else np.where(self.count > 0, -1, 0)
        return Reach(
            size,
            (self.count > 0).reshape(self.shape),
            counted.reshape(self.shape),
            {measure: value.reshape(self.shape) for measure, value in self.values.items()},
            self.q.reshape(*self.shape, -1),
        )
