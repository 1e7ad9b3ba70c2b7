"""Draws the flowcharts of Mermaid that the pages have, from top to bottom, as a picture in the page: without a script, and without what a
script would fetch from elsewhere. Of Mermaid it knows `NAME[LABEL] -->|TEXT| NAME`, in chains."""

import re
from html import escape

from docutils import nodes
from docutils.parsers.rst import Directive

ROW, BOX, GAP = 74, 28, 46


class Flowchart(Directive):
    has_content = True

    def run(self):
        labels, edges = read(self.content)
        return [nodes.raw("", draw(labels, edges), format="html")]


def read(lines):
    """The labels of nodes by their names, and edges: from, text, to."""
    labels, edges = {}, []
    for line in lines:
        if line.startswith("flowchart") or not line.strip():
            continue
        names, texts = [], []
        for part in re.split(r"\s*(-->(?:\|[^|]*\|)?)\s*", line.strip()):
            if part.startswith("-->"):
                texts.append(part[3:].strip("|"))
                continue
            node = re.fullmatch(r"(\w+)(?:\[(.*)\])?", part)
            if not node:
                raise ValueError(f"a flowchart cannot be read at `{part}`")
            labels.setdefault(node[1], node[1])
            if node[2]:
                labels[node[1]] = node[2]
            names.append(node[1])
        edges += zip(names, texts, names[1:])
    return labels, edges


def draw(labels, edges):
    # The row of a node is below all that it comes from.
    row = {}
    while len(row) < len(labels):
        for name in labels:
            before = [start for start, _, end in edges if end == name]
            if name not in row and all(start in row for start in before):
                row[name] = max((row[start] + 1 for start in before), default=0)
                break
        else:
            raise ValueError("a flowchart has a circle")
    rows = [[name for name in labels if row[name] == number] for number in range(max(row.values()) + 1)]
    wide = {name: 7.9 * len(label) + 20 for name, label in labels.items()}
    step = max(wide.values()) + GAP
    width = step * max(len(names) for names in rows)
    place = {}
    for number, names in enumerate(rows):
        above = {name: [place[start][0] for start, _, end in edges if end == name] for name in names}
        names.sort(key=lambda name: sum(above[name]) / max(1, len(above[name])))
        left = width / 2 - step * (len(names) - 1) / 2
        place |= {name: (left + step * column, number * ROW + BOX / 2 + 1) for column, name in enumerate(names)}
    lines, texts = [], []
    for start, text, end in edges:
        (x1, y1), (x2, y2) = place[start], place[end]
        y1, y2 = y1 + BOX / 2, y2 - BOX / 2
        middle = (y1 + y2) / 2
        lines.append(f'<path d="M{x1:.0f} {y1:.0f}C{x1:.0f} {middle:.0f} {x2:.0f} {middle:.0f} {x2:.0f} {y2:.0f}" marker-end="url(#arrow)"/>')
        if text:
            texts.append(f'<text class="edge" x="{(x1 + x2) / 2:.0f}" y="{middle + 4:.0f}">{escape(text)}</text>')
    boxes = [
        f'<rect x="{x - wide[name] / 2:.0f}" y="{y - BOX / 2:.0f}" width="{wide[name]:.0f}" height="{BOX}" rx="4"/>'
        f'<text x="{x:.0f}" y="{y + 4:.0f}">{escape(labels[name])}</text>'
        for name, (x, y) in place.items()
    ]
    height = len(rows) * ROW - (ROW - BOX) + 2
    said = escape("; ".join(f"{labels[start]} to {labels[end]}{': ' + text if text else ''}" for start, text, end in edges))
    arrow = (
        '<marker id="arrow" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0 0L8 4L0 8"/></marker>'
    )
    return (
        f'<svg class="flowchart" viewBox="0 0 {width:.0f} {height}" width="{width:.0f}" role="img" aria-label="{said}">'
        f"<defs>{arrow}</defs>{''.join(lines + boxes + texts)}</svg>"
    )
