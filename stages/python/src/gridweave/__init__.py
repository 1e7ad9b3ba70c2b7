"""Stages of Gridweave in Python: a class or a function with typed ports.

    import numpy as np
    from gridweave import stage
    from gridweave.msg.nav_msgs import OccupancyGrid

    @stage(output="inverted")
    def invert(map: OccupancyGrid, *, level: int = 50) -> OccupancyGrid:
        \"\"\"Makes free what is occupied, and occupied what is free.\"\"\"
        cells = np.where(map.data < 0, -1, np.where(map.data >= level, 0, 100))
        return OccupancyGrid(map.header, map.info, cells)

A pipeline file names the module, and its parameters as those of any stage:

    [stages.invert]
    kind = "python"
    module = "invert.py"
    inputs = ["log.map"]
    level = 65
"""

from .stage import About, Context, Input, Output, Parameter, Stage, stage

__all__ = ["About", "Context", "Input", "Output", "Parameter", "Stage", "stage"]
