"""The walls of maps by OpenCV: a stage in place of `line_extractor`."""

import cv2
import numpy as np

from gridweave import Input, Output, Parameter, Stage
from gridweave.msg.gridweave_msgs import Segment, Segments
from gridweave.msg.nav_msgs import OccupancyGrid


class OpenCvLines(Stage):
    """Finds the straight walls of every map by the probabilistic Hough transform of OpenCV."""

    map = Input(OccupancyGrid, "the robots' maps")
    segments = Output(Segments, "the straight walls of each map")
    min_length = Parameter(0.6, "shorter walls are left out, metres", above=0.0)
    max_gap = Parameter(0.15, "the longest gap within a wall, metres", minimum=0.0)
    votes = Parameter(12, "so many occupied cells at least lie on a wall", minimum=1)

    def on_map(self, map, about):
        info, resolution = map.info, map.info.resolution
        if info.width * info.height != len(map.data) or not resolution > 0.0:
            return self.warn(f"a map of {about.robot} was left out: it has not width x height cells of a size")
        cells = map.data.reshape(info.height, info.width)
        walls = ((cells >= 65) & (cells <= 100)).astype(np.uint8)
        length, gap = self.min_length / resolution, self.max_gap / resolution
        lines = cv2.HoughLinesP(walls, 1, np.pi / 360, self.votes, minLineLength=length, maxLineGap=gap)
        segments = [self.segment(walls, info, *line) for line in np.reshape([] if lines is None else lines, (-1, 4)).tolist()]
        segments.sort(key=lambda segment: -segment.inliers)
        self.segments.send(Segments(map.header, about.robot, segments), about.robot)

    def segment(self, walls, info, column1, row1, column2, row2):
        steps = max(abs(column2 - column1), abs(row2 - row1)) + 1
        columns, rows = np.linspace(column1, column2, steps).round(), np.linspace(row1, row2, steps).round()
        on = walls[rows.astype(int), columns.astype(int)]
        turn = 2.0 * np.arctan2(info.origin.orientation.z, info.origin.orientation.w)
        cells = np.array([[column1, row1], [column2, row2]]) + 0.5
        turned = cells * info.resolution @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
        (x1, y1), (x2, y2) = (turned + [info.origin.position.x, info.origin.position.y]).tolist()
        return Segment(x1, y1, x2, y2, float(on.mean()), int(on.sum()))
