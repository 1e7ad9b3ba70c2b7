"""The result of a merge, or of another pipeline."""

import base64
import html
import io
import json
import math
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from typing import Any, Callable, Iterator

import numpy as np

from . import _native
from .map import Map


@dataclass(frozen=True, eq=False)
class Frame:
    """The pose of a robot's map frame in the merged frame."""

    #: Metres.
    x: float
    #: Metres.
    y: float
    #: Radians.
    yaw: float
    #: The covariance of (x, y, yaw), 3 x 3; zero for the reference.
    covariance: np.ndarray

    @property
    def matrix(self) -> np.ndarray:
        """The transform from the map frame to the merged frame, 3 x 3 homogeneous."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return np.array([[cos, -sin, self.x], [sin, cos, self.y], [0.0, 0.0, 1.0]])

    def __repr__(self) -> str:
        return f"Frame(x={self.x:.3f}, y={self.y:.3f}, yaw={self.yaw:.4f})"


@dataclass(frozen=True)
class Pair:
    """The outcome of a pair of robots: the transform from the map of ``b`` to that of ``a``."""

    a: str
    b: str
    #: What found it, such as `maps+icp`.
    method: str
    #: Metres.
    x: float
    #: Metres.
    y: float
    #: Radians.
    yaw: float
    #: The probability that the transform is right, 0 to 1.
    probability: float
    #: Whether it was merged.
    accepted: bool
    #: Whether the maps were compared at it.
    checked: bool
    #: Why it was accepted or refused: a sentence, and behind an empty line the evidence term by term.
    reason: str


@dataclass(frozen=True)
class Group:
    """Robots that are merged with each other, and not with the reference."""

    reference: str
    frames: dict[str, Frame]


@dataclass(frozen=True)
class Deformation:
    """How a map is deformed before its frame is applied, so that its walls agree with those of the other maps: a function on points."""

    #: The greatest displacement, metres.
    largest: float
    #: The distance between the nodes, metres.
    spacing: float
    #: Its nodes: x, y, and their displacements along x and y (metres) and rotation (radians); N x 5.
    nodes: np.ndarray = field(repr=False)

    def __call__(self, points: Any) -> np.ndarray:
        """Deforms points of the map, N x 2 or one (x, y), metres."""
        points = np.asarray(points, dtype=float)
        return _native.deform(self.spacing, self.nodes.tolist(), np.atleast_2d(points)).reshape(points.shape)


@dataclass(frozen=True)
class StageStatistics:
    """What a stage has done in a run."""

    messages_in: int
    messages_out: int
    #: The time of its work, milliseconds.
    busy_ms: float
    #: Its warnings about its input, with their counts.
    warnings: dict[str, int]
    #: Counts of its work.
    counts: dict[str, int]


class MergeResult:
    """The frames of the merged robots, the merged map, and why others could not be merged."""

    def __init__(self, summary: str, grid: Any, rerun: Callable[..., Any]):
        #: The summary as `gridweave merge --summary` writes it.
        self.summary: dict[str, Any] = json.loads(summary)
        #: The merged map in the frame of the reference; None if there is none.
        self.map: Map | None = None if grid is None else Map(*grid)
        self._rerun = rerun

    @property
    def reference(self) -> str | None:
        """The robot whose map frame is that of the merged map."""
        return self.summary.get("reference")

    @cached_property
    def frames(self) -> dict[str, Frame]:
        """The frames of the merged robots."""
        return _frames(self.summary.get("frames", {}))

    @property
    def unmerged(self) -> dict[str, str]:
        """The robots that could not be merged, each with the reason."""
        return self.summary.get("unmerged", {})

    @cached_property
    def groups(self) -> list[Group]:
        """The robots that are merged with each other only."""
        return [Group(group["reference"], _frames(group["frames"])) for group in self.summary.get("groups", [])]

    @cached_property
    def pairs(self) -> list[Pair]:
        """The outcome of each pair of robots."""
        pairs = (dict(pair) for pair in self.summary.get("alignments", []))
        return [Pair(probability=pair.pop("score"), **pair) for pair in pairs]

    @cached_property
    def deformations(self) -> dict[str, Deformation]:
        """The deformation of each map that was deformed."""
        bends = self.summary.get("bends", {})
        return {robot: Deformation(bend["largest_m"], bend["spacing"], np.array(bend["nodes"])) for robot, bend in bends.items()}

    @cached_property
    def stages(self) -> dict[str, StageStatistics]:
        """What each stage has done."""
        return {
            name: StageStatistics(stage["messages_in"], stage["messages_out"], stage["busy_ms"], stage.get("warnings", {}),
                                  stage.get("counts", {}))
            for name, stage in self.summary.get("stages", {}).items()
        }

    @property
    def warnings(self) -> dict[str, int]:
        """The warnings of all stages, with their counts."""
        return {f"{name}: {text}": count for name, stage in self.stages.items() for text, count in stage.warnings.items()}

    @property
    def is_complete(self) -> bool:
        """Whether every robot was merged."""
        return bool(self.frames) and not self.unmerged

    def transform(self, robot: str, points: Any) -> np.ndarray:
        """Transforms points of a robot's map, N x 2 or one (x, y) in metres, to the merged frame: deformed, and then by its frame."""
        if robot not in self.frames:
            known = ", ".join(self.frames) or "none"
            raise _native.RequestError(f"`{robot}` is not merged: {self.unmerged.get(robot, f'the merged robots are {known}')}")
        points = np.asarray(points, dtype=float)
        if robot in self.deformations:
            points = self.deformations[robot](points)
        matrix = self.frames[robot].matrix
        return points @ matrix[:2, :2].T + matrix[:2, 2]

    def to_yaml(self, file: str | PathLike[str]) -> None:
        """Writes the merged map as a map file of nav2's map server, with the image beside it."""
        if self.map is None:
            raise _native.GridweaveError("there is no merged map to write")
        self.map.save(file)

    def to_mcap(self, file: str | PathLike[str]) -> None:
        """Writes a log with the maps, the frames and the merged map, for Foxglove, `gridweave report` and ROS. It runs the merge once
        more, which gives the same result."""
        self._rerun(file)

    def plot(self, axes: Any = None) -> Any:
        """Draws the merged map and the frame of each robot, by an arrow of 1 m along its x, with matplotlib, and returns the axes."""
        import matplotlib.pyplot as plt

        axes = axes or plt.subplots(layout="constrained")[1]
        if self.map is not None:
            shade = np.where(self.map.cells < 0, 70.0, 100.0 - self.map.cells)
            axes.imshow(shade, origin="lower", extent=self.map.extent, cmap="gray", vmin=0, vmax=100, interpolation="nearest")
        for number, (robot, frame) in enumerate(self.frames.items()):
            ahead = (frame.x + math.cos(frame.yaw), frame.y + math.sin(frame.yaw))
            arrow = {"arrowstyle": "->", "color": f"C{number}", "lw": 2, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", ahead, (frame.x, frame.y), arrowprops=arrow)
            axes.text(*ahead, f" {robot}", color=f"C{number}", va="center")
        axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
        return axes

    def _rows(self) -> Iterator[tuple[str, str, str]]:
        for robot, frame in self.frames.items():
            at = f"x {frame.x:.2f} m, y {frame.y:.2f} m, yaw {math.degrees(frame.yaw):.1f} deg"
            yield robot, at, "reference" if robot == self.reference else "merged"
        for robot, reason in self.unmerged.items():
            yield robot, reason.split("\n\n")[0], "not merged"

    def __repr__(self) -> str:
        lines = [f"{robot}: {outcome}, {where}" for robot, where, outcome in self._rows()]
        return "<MergeResult\n  " + "\n  ".join([*lines, repr(self.map)]) + ">"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(robot)}</td><td>{html.escape(outcome)}</td><td>{html.escape(where)}</td></tr>"
            for robot, where, outcome in self._rows()
        )
        return f"<table><tr><th>robot</th><th></th><th>frame</th></tr>{rows}</table>{self._picture()}"

    def _picture(self) -> str:
        """The plot as HTML; empty without matplotlib."""
        try:
            from matplotlib.figure import Figure
        except ImportError:
            return ""
        figure = Figure(layout="constrained")
        self.plot(figure.subplots())
        picture = io.BytesIO()
        figure.savefig(picture, format="png", dpi=80)
        return f'<img src="data:image/png;base64,{base64.b64encode(picture.getvalue()).decode()}">'


def _frames(frames: dict[str, Any]) -> dict[str, Frame]:
    return {
        robot: Frame(frame["x"], frame["y"], frame["yaw"], np.array(frame["covariance"]).reshape(3, 3))
        for robot, frame in frames.items()
    }
