"""The result of a merge, or of another pipeline."""

import base64
import html
import io
import json
import math
import re
import tempfile
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from .inputs import Given, check_is_no_input
from .map import Map
from .request import FilePath, Progress, path_of, watch

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class Frame:
    """The pose of a robot's map frame in the merged frame.

    Attributes:
        x: Metres.
        y: Metres.
        yaw: Radians.
        covariance: The covariance of (x, y, yaw), 3 x 3, in metres and radians; zero for the reference.
    """

    x: float
    y: float
    yaw: float
    covariance: NDArray[np.float64]

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The transform from the map frame to the merged frame, 3 x 3 homogeneous."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return np.array([[cos, -sin, self.x], [sin, cos, self.y], [0.0, 0.0, 1.0]])

    def __repr__(self) -> str:
        return f"Frame(x={self.x:.3f}, y={self.y:.3f}, yaw={self.yaw:.4f})"


@dataclass(frozen=True)
class Evidence:
    """The agreement of the maps of a pair of robots.

    Attributes:
        hypotheses: The number of hypotheses that were judged.
        overlap_m2: The area that is known in both maps, square metres.
        wall_on_wall_m: Walls of one map on walls of the other, metres.
        wall_on_free_m: Walls of one map on free space of the other, metres.
        elsewhere: The evidence for the second-best hypothesis, as a share of that for this one.
    """

    hypotheses: int
    overlap_m2: float
    wall_on_wall_m: float
    wall_on_free_m: float
    elsewhere: float


@dataclass(frozen=True)
class Pair:
    """The outcome of a pair of robots: the transform from the map of ``b`` to that of ``a``.

    Attributes:
        a: A robot.
        b: The other robot.
        method: What found the transform, such as ``maps+icp``.
        x: Metres.
        y: Metres.
        yaw: Radians.
        probability: The probability that the transform is right, 0 to 1.
        accepted: Whether it was merged.
        checked: Whether transforms of other pairs, one after the other, confirm it.
        reason: Why it was accepted or refused: a sentence, and behind an empty line the evidence term by term.
        evidence: The agreement of the maps; None if they were not compared.
    """

    a: str
    b: str
    method: str
    x: float
    y: float
    yaw: float
    probability: float
    accepted: bool
    checked: bool
    reason: str
    evidence: Evidence | None


@dataclass(frozen=True)
class Group:
    """Robots that are merged with each other, and not with the reference.

    Attributes:
        reference: The robot of them whose map frame is the frame of the group.
        frames: The frames of the robots in it.
    """

    reference: str
    frames: dict[str, Frame]


@dataclass(frozen=True)
class Deformation:
    """How a map is deformed before its frame is applied, so that its walls agree with those of the other maps: a function on points.

    Attributes:
        largest: The greatest displacement, metres.
        spacing: The distance between the nodes, metres.
        nodes: Its nodes: x, y, and their displacements along x and y (metres) and rotation (radians); N x 5.
    """

    largest: float
    spacing: float
    nodes: NDArray[np.float64] = field(repr=False)

    def __call__(self, points: ArrayLike) -> NDArray[np.float64]:
        """Deforms points of the map, N x 2 or one (x, y), metres.

        Raises:
            RequestError: They are no such points.
        """
        at = _points(points)
        return _native.deform(self.spacing, self.nodes.tolist(), np.atleast_2d(at)).reshape(at.shape)


@dataclass(frozen=True)
class StageStatistics:
    """What a stage has done in a run.

    Attributes:
        messages_in: How many messages it was given.
        messages_out: How many messages it has sent.
        busy_ms: The time of its work, milliseconds.
        warnings: Its warnings about its input, with their counts.
        counts: Counts of its work.
    """

    messages_in: int
    messages_out: int
    busy_ms: float
    warnings: dict[str, int]
    counts: dict[str, int]


#: Runs a merge again as it was asked for, with an output.
Rerun = Callable[[str], tuple[str, Any]]


class MergeResult:
    """The frames of the merged robots, the merged map, and why others could not be merged.

    It can be pickled; what comes back has everything but `to_mcap`.

    Attributes:
        summary: The summary as ``gridweave merge --summary`` writes it.
        map: The merged map in the frame of the reference; None if there is none.
    """

    summary: dict[str, Any]
    map: Map | None

    def __init__(self, summary: str, grid: Any, rerun: Rerun | None = None, inputs: Sequence[Path] = ()):
        self.summary = json.loads(summary)
        self.map = None if grid is None else Map(*grid)
        self._rerun = rerun
        self._inputs = list(inputs)

    def __getstate__(self) -> dict[str, Any]:
        # The inputs of a run may be anything, such as a stage of the user's own.
        return self.__dict__ | {"_rerun": None}

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
        return {robot: _in_python(reason) for robot, reason in self.summary.get("unmerged", {}).items()}

    @cached_property
    def groups(self) -> list[Group]:
        """The robots that are merged with each other only."""
        return [Group(group["reference"], _frames(group["frames"])) for group in self.summary.get("groups", [])]

    @cached_property
    def pairs(self) -> list[Pair]:
        """The outcome of each pair of robots."""
        return [_pair(**pair) for pair in self.summary.get("alignments", [])]

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

    def transform(self, robot: str, points: ArrayLike) -> NDArray[np.float64]:
        """Transforms points of a robot's map, N x 2 or one (x, y) in metres, to the merged frame: deformed, and then by its frame.

        Raises:
            RequestError: The robot is not merged, or these are no such points.
        """
        if robot not in self.frames:
            known = ", ".join(self.frames) or "none"
            raise _native.RequestError(f"`{robot}` is not merged: {self.unmerged.get(robot, f'the merged robots are {known}')}")
        at = _points(points)
        if robot in self.deformations:
            at = self.deformations[robot](at)
        matrix = self.frames[robot].matrix
        return at @ matrix[:2, :2].T + matrix[:2, 2]

    def to_yaml(self, file: FilePath) -> None:
        """Writes the merged map as a map file of nav2's map server, with the image beside it.

        Raises:
            RequestError: The name of the file ends neither in .yaml nor in .yml, or it is an input.
            GridweaveError: There is no merged map, or it cannot be written.
        """
        if self.map is None:
            raise _native.GridweaveError("there is no merged map to write")
        path = Path(path_of(file))
        for written in (path, path.with_suffix(".pgm") if path.name else path):
            check_is_no_input(written, self._inputs)
        self.map.save(file)

    def to_mcap(self, file: FilePath) -> None:
        """Writes a log with the maps, the frames and the merged map, for Foxglove, ``gridweave report`` and ROS.

        It runs the merge once more, on the arrays and with the settings as they were, and on the files as they are.

        Raises:
            RequestError: The name of the file is that of another format, or it is an input.
            GridweaveError: A file of the input has changed since, or the log cannot be written; or the result was pickled or copied.
        """
        if self._rerun is None:
            raise _native.GridweaveError("a result that was pickled or copied does not hold its inputs: merge once more, with `output=` for the log")
        target = Path(path_of(file))
        check_is_no_input(target, self._inputs)
        try:
            # What is there already is replaced by a whole log only.
            with tempfile.TemporaryDirectory(prefix=".gridweave-", dir=target.parent) as folder:
                written = Path(folder) / target.name
                try:
                    again = MergeResult(*self._rerun(str(written)))
                except _native.GridweaveError as error:
                    raise type(error)(str(error).replace(str(written.parent), str(target.parent))) from error.__cause__
                if not self._is_same_as(again):
                    raise _native.GridweaveError(
                        f"{target} was not written: the merge gives another result than before, as an input has changed since; merge once more"
                    )
                written.replace(target)
        except OSError as error:
            raise _native.GridweaveError(f"cannot write {target}: {error.strerror}") from None

    def _is_same_as(self, other: "MergeResult") -> bool:
        parts = ("reference", "frames", "unmerged")
        ours, theirs = ({part: result.summary.get(part) for part in parts} for result in (self, other))
        if ours != theirs or self.map is None or other.map is None:
            return ours == theirs and self.map is other.map
        return self.map.origin == other.map.origin and np.array_equal(self.map.cells, other.map.cells)

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draws the merged map and the frame of each robot, by an arrow of 1 m along its x, with matplotlib, and returns the axes. The
        title names the robots that are not merged.

        Raises:
            RequestError: matplotlib is not installed.
        """
        from .drawing import draw

        return draw(self, axes)

    def _rows(self) -> Iterator[tuple[str, str, str]]:
        for robot, frame in self.frames.items():
            at = f"x {frame.x:.2f} m, y {frame.y:.2f} m, yaw {math.degrees(frame.yaw):.1f} deg"
            yield robot, at, "reference" if robot == self.reference else "merged"
        for robot, reason in self.unmerged.items():
            yield robot, reason.split("\n\n")[0], "not merged"

    def __repr__(self) -> str:
        lines = [f"{robot}: {outcome}, {where}" for robot, where, outcome in self._rows()]
        lines += [f"warning: {text}" for text in self._warned()] + ([] if self.map is None else [repr(self.map)])
        return "<MergeResult" + "".join(f"\n  {line}" for line in lines) + ">"

    def _warned(self) -> list[str]:
        return [text if count == 1 else f"{text} ({count} times)" for text, count in self.warnings.items()]

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(robot)}</td><td>{html.escape(outcome)}</td><td>{html.escape(where)}</td></tr>"
            for robot, where, outcome in self._rows()
        )
        warned = "".join(f"<p>warning: {html.escape(text)}</p>" for text in self._warned())
        return f"<table><tr><th>robot</th><th></th><th>frame</th></tr>{rows}</table>{warned}{self._picture()}"

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


def _pair(*, score: float, reason: str, evidence: dict[str, Any] | None = None, **same: Any) -> Pair:
    agreement = None if evidence is None else Evidence(**evidence)
    return Pair(probability=score, reason=_in_python(reason), evidence=agreement, **same)


def _frames(frames: dict[str, Any]) -> dict[str, Frame]:
    return {
        robot: Frame(frame["x"], frame["y"], frame["yaw"], np.array(frame["covariance"]).reshape(3, 3))
        for robot, frame in frames.items()
    }


def result_of(
    given: Given, asked: Callable[[str | None], _native.Request], output: FilePath | None, progress: Progress, what: str
) -> MergeResult:
    """Runs what was asked for on what was given.

    Raises:
        RequestError: The request is wrong.
        GridweaveError: The run has failed.
    """
    file = None if output is None else path_of(output)
    if file is not None:
        check_is_no_input(Path(file), given.files)
    with watch(progress, what) as report:
        summary, grid = given.run(asked(file), report)
    return MergeResult(summary, grid, lambda output: given.run(asked(output), None), given.files)


def _points(given: ArrayLike) -> NDArray[np.float64]:
    try:
        points = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise _native.RequestError("points are N x 2 or one (x, y), in metres, and these are no such numbers") from None
    if points.ndim not in (1, 2) or points.shape[-1] != 2:
        raise _native.RequestError(f"points are N x 2 or one (x, y), in metres, and these are an array of the shape {points.shape}")
    return points


def _in_python(reason: str) -> str:
    """A reason with the arguments of Python in place of the options of the command."""
    reason = re.sub(r"--(initial|accept) (.+?)=(X,Y,YAW(?:,STDDEV)?|N\b)", _argument, reason)
    reason = re.sub(r"--set ([\w.]+\w)", r'parameters={"\1": ...}', reason)
    options = r"--(accept|initial|lidar|literal-thresholds|reference|rename)\b"
    return re.sub(options, lambda option: f"`{option[1].replace('-', '_')}=`", reason)


def _argument(option: "re.Match[str]") -> str:
    name, robot, value = option.groups()
    return f'{name}={{"{robot}": {value if name == "accept" else "(" + value.replace(",", ", ") + ")"}}}'
