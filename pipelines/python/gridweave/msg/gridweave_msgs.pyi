"""The message types of `gridweave_msgs`."""

# Written by `pipelines/python/stubs.py` from the texts in `logs/msg`.

from dataclasses import Field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import geometry_msgs, std_msgs

class Alignment:
    """The ROS 2 message `gridweave_msgs/msg/Alignment`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    a: str
    b: str
    source: str
    has_transform: bool
    x: float
    y: float
    yaw: float
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    @covariance.setter
    def covariance(self, value: ArrayLike) -> None: ...
    score: float
    margin: float
    method: str
    accepted: bool
    provisional: bool
    rank: int
    hypotheses: int
    reason: str
    def __init__(
        self,
        header: std_msgs.Header = ...,
        a: str = ...,
        b: str = ...,
        source: str = ...,
        has_transform: bool = ...,
        x: float = ...,
        y: float = ...,
        yaw: float = ...,
        covariance: ArrayLike = ...,
        score: float = ...,
        margin: float = ...,
        method: str = ...,
        accepted: bool = ...,
        provisional: bool = ...,
        rank: int = ...,
        hypotheses: int = ...,
        reason: str = ...,
    ) -> None: ...

class CommonPlace:
    """The ROS 2 message `gridweave_msgs/msg/CommonPlace`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    @property
    def first(self) -> NDArray[np.float64]: ...
    @first.setter
    def first(self, value: ArrayLike) -> None: ...
    @property
    def second(self) -> NDArray[np.float64]: ...
    @second.setter
    def second(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        first: ArrayLike = ...,
        second: ArrayLike = ...,
    ) -> None: ...

class CommonTag:
    """The ROS 2 message `gridweave_msgs/msg/CommonTag`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    tag_id: str
    @property
    def a(self) -> NDArray[np.float64]: ...
    @a.setter
    def a(self, value: ArrayLike) -> None: ...
    @property
    def b(self) -> NDArray[np.float64]: ...
    @b.setter
    def b(self, value: ArrayLike) -> None: ...
    @property
    def covariance_a(self) -> NDArray[np.float64]: ...
    @covariance_a.setter
    def covariance_a(self, value: ArrayLike) -> None: ...
    @property
    def covariance_b(self) -> NDArray[np.float64]: ...
    @covariance_b.setter
    def covariance_b(self, value: ArrayLike) -> None: ...
    certainty_a: float
    certainty_b: float
    def __init__(
        self,
        tag_id: str = ...,
        a: ArrayLike = ...,
        b: ArrayLike = ...,
        covariance_a: ArrayLike = ...,
        covariance_b: ArrayLike = ...,
        certainty_a: float = ...,
        certainty_b: float = ...,
    ) -> None: ...

class CommonTags:
    """The ROS 2 message `gridweave_msgs/msg/CommonTags`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    robot_a: str
    robot_b: str
    tags: list[CommonTag]
    accepted: bool
    provisional: bool
    reason: str
    def __init__(
        self,
        header: std_msgs.Header = ...,
        robot_a: str = ...,
        robot_b: str = ...,
        tags: list[CommonTag] = ...,
        accepted: bool = ...,
        provisional: bool = ...,
        reason: str = ...,
    ) -> None: ...

class DeformationNode:
    """The ROS 2 message `gridweave_msgs/msg/DeformationNode`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    x: float
    y: float
    dx: float
    dy: float
    dyaw: float
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    @covariance.setter
    def covariance(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        x: float = ...,
        y: float = ...,
        dx: float = ...,
        dy: float = ...,
        dyaw: float = ...,
        covariance: ArrayLike = ...,
    ) -> None: ...

class Evidence:
    """The ROS 2 message `gridweave_msgs/msg/Evidence`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    a: str
    b: str
    hypotheses: int
    overlap: float
    wall_on_wall: float
    wall_on_free: float
    evidence_elsewhere: float
    def __init__(
        self,
        header: std_msgs.Header = ...,
        a: str = ...,
        b: str = ...,
        hypotheses: int = ...,
        overlap: float = ...,
        wall_on_wall: float = ...,
        wall_on_free: float = ...,
        evidence_elsewhere: float = ...,
    ) -> None: ...

class IcpErrors:
    """The ROS 2 message `gridweave_msgs/msg/IcpErrors`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    a: str
    b: str
    source: str
    rank: int
    accepted: bool
    @property
    def errors(self) -> NDArray[np.float64]: ...
    @errors.setter
    def errors(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        header: std_msgs.Header = ...,
        a: str = ...,
        b: str = ...,
        source: str = ...,
        rank: int = ...,
        accepted: bool = ...,
        errors: ArrayLike = ...,
    ) -> None: ...

class MachineStages:
    """The ROS 2 message `gridweave_msgs/msg/MachineStages`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    machine: str
    interval: float
    stages: list[StageProgress]
    def __init__(
        self,
        header: std_msgs.Header = ...,
        machine: str = ...,
        interval: float = ...,
        stages: list[StageProgress] = ...,
    ) -> None: ...

class MapAgreement:
    """The ROS 2 message `gridweave_msgs/msg/MapAgreement`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    known_to_one: float
    known_to_several: float
    in_conflict: float
    def __init__(
        self,
        header: std_msgs.Header = ...,
        known_to_one: float = ...,
        known_to_several: float = ...,
        in_conflict: float = ...,
    ) -> None: ...

class MapDeformation:
    """The ROS 2 message `gridweave_msgs/msg/MapDeformation`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    robot: str
    spacing: float
    nodes: list[DeformationNode]
    wall_matched: float
    sharpness_rigid: Sharpness
    sharpness: Sharpness
    bend: float
    turn: float
    def __init__(
        self,
        header: std_msgs.Header = ...,
        robot: str = ...,
        spacing: float = ...,
        nodes: list[DeformationNode] = ...,
        wall_matched: float = ...,
        sharpness_rigid: Sharpness = ...,
        sharpness: Sharpness = ...,
        bend: float = ...,
        turn: float = ...,
    ) -> None: ...

class MapDirection:
    """The ROS 2 message `gridweave_msgs/msg/MapDirection`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    robot: str
    direction: float
    deviation: float
    @property
    def groups(self) -> NDArray[np.float64]: ...
    @groups.setter
    def groups(self, value: ArrayLike) -> None: ...
    agreement: float
    valid: bool
    def __init__(
        self,
        header: std_msgs.Header = ...,
        robot: str = ...,
        direction: float = ...,
        deviation: float = ...,
        groups: ArrayLike = ...,
        agreement: float = ...,
        valid: bool = ...,
    ) -> None: ...

class RangeScan:
    """The ROS 2 message `gridweave_msgs/msg/RangeScan`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    x: float
    y: float
    yaw: float
    angle_min: float
    angle_increment: float
    time_increment: float
    range_min: float
    range_max: float
    @property
    def ranges(self) -> NDArray[np.float32]: ...
    @ranges.setter
    def ranges(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        header: std_msgs.Header = ...,
        x: float = ...,
        y: float = ...,
        yaw: float = ...,
        angle_min: float = ...,
        angle_increment: float = ...,
        time_increment: float = ...,
        range_min: float = ...,
        range_max: float = ...,
        ranges: ArrayLike = ...,
    ) -> None: ...

class RobotFrame:
    """The ROS 2 message `gridweave_msgs/msg/RobotFrame`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    robot: str
    frame_id: str
    x: float
    y: float
    yaw: float
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    @covariance.setter
    def covariance(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        robot: str = ...,
        frame_id: str = ...,
        x: float = ...,
        y: float = ...,
        yaw: float = ...,
        covariance: ArrayLike = ...,
    ) -> None: ...

class RobotFrames:
    """The ROS 2 message `gridweave_msgs/msg/RobotFrames`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    reference: str
    frames: list[RobotFrame]
    unmerged: list[UnmergedRobot]
    groups: list[RobotGroup]
    def __init__(
        self,
        header: std_msgs.Header = ...,
        reference: str = ...,
        frames: list[RobotFrame] = ...,
        unmerged: list[UnmergedRobot] = ...,
        groups: list[RobotGroup] = ...,
    ) -> None: ...

class RobotGroup:
    """The ROS 2 message `gridweave_msgs/msg/RobotGroup`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    reference: str
    frame_id: str
    frames: list[RobotFrame]
    def __init__(
        self,
        reference: str = ...,
        frame_id: str = ...,
        frames: list[RobotFrame] = ...,
    ) -> None: ...

class Segment:
    """The ROS 2 message `gridweave_msgs/msg/Segment`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    x1: float
    y1: float
    x2: float
    y2: float
    reliability: float
    inliers: int
    def __init__(
        self,
        x1: float = ...,
        y1: float = ...,
        x2: float = ...,
        y2: float = ...,
        reliability: float = ...,
        inliers: int = ...,
    ) -> None: ...

class Segments:
    """The ROS 2 message `gridweave_msgs/msg/Segments`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    robot: str
    segments: list[Segment]
    def __init__(
        self,
        header: std_msgs.Header = ...,
        robot: str = ...,
        segments: list[Segment] = ...,
    ) -> None: ...

class Sharpness:
    """The ROS 2 message `gridweave_msgs/msg/Sharpness`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    apart: float
    doubled: float
    def __init__(
        self,
        apart: float = ...,
        doubled: float = ...,
    ) -> None: ...

class SimulationTruth:
    """The ROS 2 message `gridweave_msgs/msg/SimulationTruth`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    resolution: float
    frames: list[TrueFrame]
    tags: list[TrueTag]
    common: list[CommonPlace]
    def __init__(
        self,
        header: std_msgs.Header = ...,
        resolution: float = ...,
        frames: list[TrueFrame] = ...,
        tags: list[TrueTag] = ...,
        common: list[CommonPlace] = ...,
    ) -> None: ...

class StageProgress:
    """The ROS 2 message `gridweave_msgs/msg/StageProgress`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    name: str
    state: str
    messages_in: int
    messages_out: int
    in_per_s: float
    out_per_s: float
    busy: float
    dropped: int
    restarts: int
    warnings: int
    def __init__(
        self,
        name: str = ...,
        state: str = ...,
        messages_in: int = ...,
        messages_out: int = ...,
        in_per_s: float = ...,
        out_per_s: float = ...,
        busy: float = ...,
        dropped: int = ...,
        restarts: int = ...,
        warnings: int = ...,
    ) -> None: ...

class TagBearing:
    """The ROS 2 message `gridweave_msgs/msg/TagBearing`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    tag_id: str
    x: float
    y: float
    bearing: float
    bearing_stddev: float
    def __init__(
        self,
        header: std_msgs.Header = ...,
        tag_id: str = ...,
        x: float = ...,
        y: float = ...,
        bearing: float = ...,
        bearing_stddev: float = ...,
    ) -> None: ...

class TagEstimate:
    """The ROS 2 message `gridweave_msgs/msg/TagEstimate`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    tag_id: str
    x: float
    y: float
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    @covariance.setter
    def covariance(self, value: ArrayLike) -> None: ...
    certainty: float
    readings: int
    def __init__(
        self,
        tag_id: str = ...,
        x: float = ...,
        y: float = ...,
        covariance: ArrayLike = ...,
        certainty: float = ...,
        readings: int = ...,
    ) -> None: ...

class TagEstimates:
    """The ROS 2 message `gridweave_msgs/msg/TagEstimates`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    robot: str
    tags: list[TagEstimate]
    def __init__(
        self,
        header: std_msgs.Header = ...,
        robot: str = ...,
        tags: list[TagEstimate] = ...,
    ) -> None: ...

class TagPosition:
    """The ROS 2 message `gridweave_msgs/msg/TagPosition`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    tag_id: str
    x: float
    y: float
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    @covariance.setter
    def covariance(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        header: std_msgs.Header = ...,
        tag_id: str = ...,
        x: float = ...,
        y: float = ...,
        covariance: ArrayLike = ...,
    ) -> None: ...

class TagRange:
    """The ROS 2 message `gridweave_msgs/msg/TagRange`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    tag_id: str
    range: float
    range_stddev: float
    rssi: float
    def __init__(
        self,
        header: std_msgs.Header = ...,
        tag_id: str = ...,
        range: float = ...,
        range_stddev: float = ...,
        rssi: float = ...,
    ) -> None: ...

class TopologicalMap:
    """The ROS 2 message `gridweave_msgs/msg/TopologicalMap`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    robot: str
    nodes: list[TopologicalNode]
    paths: list[TopologicalPath]
    def __init__(
        self,
        header: std_msgs.Header = ...,
        robot: str = ...,
        nodes: list[TopologicalNode] = ...,
        paths: list[TopologicalPath] = ...,
    ) -> None: ...

class TopologicalNode:
    """The ROS 2 message `gridweave_msgs/msg/TopologicalNode`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    x: float
    y: float
    kind: str
    probability: float
    def __init__(
        self,
        x: float = ...,
        y: float = ...,
        kind: str = ...,
        probability: float = ...,
    ) -> None: ...

class TopologicalPath:
    """The ROS 2 message `gridweave_msgs/msg/TopologicalPath`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    start: int
    end: int
    length: float
    probability: float
    points: list[geometry_msgs.Point]
    def __init__(
        self,
        start: int = ...,
        end: int = ...,
        length: float = ...,
        probability: float = ...,
        points: list[geometry_msgs.Point] = ...,
    ) -> None: ...

class TrueFrame:
    """The ROS 2 message `gridweave_msgs/msg/TrueFrame`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    robot: str
    x: float
    y: float
    yaw: float
    @property
    def centre(self) -> NDArray[np.float64]: ...
    @centre.setter
    def centre(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        robot: str = ...,
        x: float = ...,
        y: float = ...,
        yaw: float = ...,
        centre: ArrayLike = ...,
    ) -> None: ...

class TrueTag:
    """The ROS 2 message `gridweave_msgs/msg/TrueTag`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    tag_id: str
    x: float
    y: float
    def __init__(
        self,
        tag_id: str = ...,
        x: float = ...,
        y: float = ...,
    ) -> None: ...

class UnmergedRobot:
    """The ROS 2 message `gridweave_msgs/msg/UnmergedRobot`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    robot: str
    reason: str
    def __init__(
        self,
        robot: str = ...,
        reason: str = ...,
    ) -> None: ...

class Verdict:
    """The ROS 2 message `gridweave_msgs/msg/Verdict`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    alignment: Alignment
    checked: bool
    def __init__(
        self,
        alignment: Alignment = ...,
        checked: bool = ...,
    ) -> None: ...

class Verdicts:
    """The ROS 2 message `gridweave_msgs/msg/Verdicts`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    verdicts: list[Verdict]
    def __init__(
        self,
        header: std_msgs.Header = ...,
        verdicts: list[Verdict] = ...,
    ) -> None: ...
