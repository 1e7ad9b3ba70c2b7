"""Shows a merged log in Rerun: the maps as Rerun draws them by itself, and the paths, walls, tags and graph, which it does not draw.

    pip install rerun-sdk==0.41.0 mcap-ros2-support==0.6.0
    python pipelines/viewers/rerun_view.py merged.mcap              # opens the viewer
    python pipelines/viewers/rerun_view.py merged.mcap -o merged.rrd

What is added is under /drawn. Maps of single robots, hypotheses, directions and texts are hidden at first: the eyes beside their
names, and `show labels` of the texts, show them.
"""

import argparse
import math
from collections import defaultdict
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

ARROW, SPHERE, LINE_STRIP, LINE_LIST, TEXT = 0, 2, 4, 5, 9
DELETE, DELETE_ALL = 2, 3
# The colours of Okabe and Ito, in the order of the robots, as everywhere in Gridweave.
COLOURS = [(0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (230, 159, 0), (86, 180, 233), (240, 228, 66)]
PATH_RADIUS, LINE_RADIUS, HEIGHT = 0.05, 0.03, 0.05
KINDS = "lines", "ellipses", "texts"


def at(pose, points):
    """Points of a shape, in its frame: poses are in the plane but for their height."""
    q, p = pose.orientation, pose.position
    yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))
    cos, sin = math.cos(yaw), math.sin(yaw)
    return [(p.x + cos * x - sin * y, p.y + sin * x + cos * y, p.z + z) for x, y, z in points]


def rgba(colour):
    return [round(255 * value) for value in (colour.r, colour.g, colour.b, colour.a)]


def draw_path(entity, path, colour):
    points = [(one.pose.position.x, one.pose.position.y, HEIGHT) for one in path.poses]
    rr.log(entity, rr.CoordinateFrame(path.header.frame_id), rr.LineStrips3D([points], radii=PATH_RADIUS, colors=[colour]))


def draw_markers(entity, markers, drawn):
    """All shapes of a topic as they are now, for each frame an entity. `drawn` are the frames that had some before."""
    frames = defaultdict(lambda: defaultdict(list))
    for one in markers:
        shapes = frames[one.header.frame_id]
        points = at(one.pose, [(point.x, point.y, point.z) for point in one.points])
        if one.type in (LINE_LIST, LINE_STRIP):
            pairs = zip(points[0::2], points[1::2]) if one.type == LINE_LIST else zip(points, points[1:])
            colours = one.colors[0::2] if one.type == LINE_LIST else one.colors
            for number, pair in enumerate(pairs):
                shapes["lines"].append(pair)
                shapes["line colours"].append(rgba(colours[number] if colours else one.color))
        elif one.type == ARROW:
            shapes["lines"].append(points or at(one.pose, [(0, 0, 0), (one.scale.x, 0, 0)]))
            shapes["line colours"].append(rgba(one.color))
        elif one.type == SPHERE:
            q = one.pose.orientation
            shapes["centres"].extend(at(one.pose, [(0, 0, 0)]))
            shapes["halves"].append([one.scale.x / 2, one.scale.y / 2, one.scale.z / 2])
            shapes["turns"].append([q.x, q.y, q.z, q.w])
            shapes["ellipse colours"].append(rgba(one.color))
        elif one.type == TEXT:
            shapes["text positions"].extend(at(one.pose, [(0, 0, 0)]))
            shapes["texts"].append(one.text)
            shapes["text colours"].append(rgba(one.color))
    for frame in drawn - set(frames):
        rr.log(f"{entity}/{frame}", rr.Clear(recursive=True))
    for frame, shapes in frames.items():
        rr.log(f"{entity}/{frame}/lines", rr.CoordinateFrame(frame),
               rr.LineStrips3D(shapes["lines"], radii=LINE_RADIUS, colors=shapes["line colours"]))
        rr.log(f"{entity}/{frame}/ellipses", rr.CoordinateFrame(frame),
               rr.Ellipsoids3D(centers=shapes["centres"], half_sizes=shapes["halves"], quaternions=shapes["turns"],
                               colors=shapes["ellipse colours"], fill_mode="majorwireframe"))
        rr.log(f"{entity}/{frame}/texts", rr.CoordinateFrame(frame),
               rr.Points3D(shapes["text positions"], radii=LINE_RADIUS, labels=shapes["texts"], show_labels=False,
                           colors=shapes["text colours"]))
    return set(frames)


def draw(log):
    """Draws what Rerun does not, and returns the last merged map, the topics of the other maps, and what was drawn of markers."""
    markers, drawn, seen, robots, merged, maps = defaultdict(dict), defaultdict(set), defaultdict(set), [], None, set()
    with open(log, "rb") as file:
        for schema, channel, message, content in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            topic = channel.topic
            rr.set_time("message_log_time", timestamp=np.datetime64(message.log_time, "ns"))
            if schema.name == "nav_msgs/msg/Path" and topic.endswith("/merged_path"):
                robots = sorted({*robots, topic.split("/")[1]})
                draw_path(f"/drawn{topic}", content, COLOURS[robots.index(topic.split("/")[1]) % len(COLOURS)])
            elif schema.name == "visualization_msgs/msg/MarkerArray":
                for one in content.markers:
                    if one.action == DELETE_ALL:
                        markers[topic].clear()
                    elif one.action == DELETE:
                        markers[topic].pop((one.ns, one.id), None)
                    else:
                        markers[topic][one.ns, one.id] = one
                drawn[topic] = draw_markers(f"/drawn{topic}", markers[topic].values(), drawn[topic])
                seen[topic] |= drawn[topic]
            elif schema.name == "nav_msgs/msg/OccupancyGrid":
                if topic == "/map":
                    merged = content
                else:
                    maps.add(topic)
    return merged, maps, {f"/drawn{topic}/{frame}/{kind}" for topic, frames in seen.items() for frame in frames for kind in KINDS}


def looking_on(merged, maps, shapes):
    """The merged map from above, at the end of the log."""
    x, y, size, frame = 0.0, 0.0, 50.0, "world"
    if merged is not None:
        info, frame = merged.info, merged.header.frame_id
        width, height = info.width * info.resolution, info.height * info.resolution
        x, y, size = info.origin.position.x + width / 2, info.origin.position.y + height / 2, max(width, height)
    hidden = {topic: rrb.EntityBehavior(visible=False) for topic in maps}
    hidden |= {entity: rrb.EntityBehavior(visible=False) for entity in shapes if "/hypotheses/" in entity or "/direction/" in entity}
    return rrb.Blueprint(
        rrb.Spatial3DView(
            origin="/", name="Merged map", background=(218, 218, 218), line_grid=False, overrides=hidden,
            spatial_information=rrb.SpatialInformation(target_frame=frame),
            eye_controls=rrb.EyeControls3D(position=(x, y, 1.3 * size), look_target=(x, y + 0.001 * size, 0), eye_up=(0, 1, 0))),
        rrb.TimePanel(timeline="message_log_time", play_state="following"),
        rrb.SelectionPanel(state="collapsed"),
    )


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("log", type=Path, help="a merged log, an MCAP file")
    arguments.add_argument("-o", "--output", type=Path, help="write a file for Rerun, and open no viewer")
    arguments = arguments.parse_args()
    rr.init("gridweave", recording_id=arguments.log.stem)
    if arguments.output:
        rr.save(arguments.output)
    else:
        rr.spawn()
    rr.log_file_from_path(arguments.log)
    rr.send_blueprint(looking_on(*draw(arguments.log)))


if __name__ == "__main__":
    main()
