"""The error of estimated poses against true ones, as the other programs here measure it."""

import json
import subprocess

import numpy as np


def poses(gridweave, log, topic):
    """Poses (x, y, yaw) in a log by time in milliseconds."""
    lines = subprocess.run([gridweave, "cat", log, "--topics", topic], capture_output=True, text=True).stdout.splitlines()
    found = {}
    for message in (json.loads(line)["message"] for line in lines):
        stamp, pose = message["header"]["stamp"], message["pose"]
        pose = pose.get("pose", pose)
        position, turn = pose["position"], pose["orientation"]
        found[stamp["sec"] * 1000 + round(stamp["nanosec"] / 1e6)] = (position["x"], position["y"], 2 * np.arctan2(turn["z"], turn["w"]))
    return found


def distances(estimated, truth):
    """Distances at the times that both have after rigid alignment, metres."""
    times = sorted(set(estimated) & set(truth))
    a, b = (np.array([track[time][:2] for time in times]) for track in (estimated, truth))
    a, b = a - a.mean(0), b - b.mean(0)
    u, _, vt = np.linalg.svd(a.T @ b)
    rotation = vt.T @ np.diag([1, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
    return np.hypot(*(a @ rotation.T - b).T)


def rms(values):
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
