"""Reads the manifest of a ROS package as colcon and ament do, with the library `catkin_pkg`, which checks it.

Argument: the folder of the package. Prints, as JSON, what it builds, depends on and belongs to.
"""

import json
import sys

from catkin_pkg.package import parse_package

warnings = []
package = parse_package(sys.argv[1], warnings=warnings)
assert not warnings, warnings
for dependency in package.build_depends:
    dependency.evaluate_condition({})
print(
    json.dumps(
        {
            "name": package.name,
            "build_type": package.get_build_type(),
            "build_depends": sorted(dependency.name for dependency in package.build_depends),
            "groups": sorted(group.name for group in package.member_of_groups),
        }
    )
)
