"""A stage from a function: maps with free and occupied swapped."""

import numpy as np

from gridweave import stage
from gridweave.msg.nav_msgs import OccupancyGrid


@stage(output="inverted")
def invert(map: OccupancyGrid, *, level: int = 50) -> OccupancyGrid:
    """Makes free what is occupied, and occupied what is free; unknown cells stay."""
    cells = np.where(map.data < 0, -1, np.where(map.data >= level, 0, 100))
    return OccupancyGrid(map.header, map.info, cells)
