"""The library zenoh-ros2-sdk, which speaks to ROS 2 over Zenoh and knows nothing of Gridweave: a session, and definitions of types.

It would fetch definitions from GitHub; here it has those in a folder, of which it makes hashes of its own.
"""

import os
import sys
from pathlib import Path

# As it stands it looks for others by multicast.
os.environ["ZENOH_CONFIG_OVERRIDE"] = 'listen/endpoints=["tcp/127.0.0.1:0"];scouting/multicast/enabled=false'

from zenoh_ros2_sdk import ZenohSession, get_registry
from zenoh_ros2_sdk.qos import QosDurability, QosProfile

LATCHED = QosProfile(durability=QosDurability.TRANSIENT_LOCAL, history_depth=1)
RELIABLE = QosProfile(history_depth=10)


def start(router, folder):
    """Opens the session, which all publishers and subscribers share, with the definitions in a folder (`PACKAGE/[msg/]TYPE.msg`)."""
    host, port = router.removeprefix("tcp/").rsplit(":", 1)
    session = ZenohSession.get_instance(host, int(port))
    definitions = Path("definitions").resolve()
    for file in Path(folder).resolve().rglob("*.msg"):
        package = file.parent.parent if file.parent.name == "msg" else file.parent
        at = definitions / package.name / "msg" / file.name
        at.parent.mkdir(parents=True, exist_ok=True)
        if not at.exists():
            at.symlink_to(file)
    get_registry(str(definitions))
    return session


def know(ros_type):
    if not get_registry().load_message_type(ros_type):
        sys.exit(f"there is no definition of {ros_type}")
