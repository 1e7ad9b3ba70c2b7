"""Stages that exchange messages of a type of their own."""

from gridweave import Input, Output, Stage
from gridweave.msg import define
from gridweave.msg.nav_msgs import OccupancyGrid

Room = define("rooms_msgs/msg/Room", "std_msgs/Header header\nstring name\nfloat32[] size\ngeometry_msgs/Point[2] corners\n")
Rooms = define("rooms_msgs/msg/Rooms", "Room[] rooms\n")


class Finder(Stage):
    """Takes each map for a room."""

    map = Input(OccupancyGrid)
    room = Output(Room)

    def on_map(self, map, about):
        size = [map.info.width * map.info.resolution, map.info.height * map.info.resolution]
        self.room.send(Room(map.header, "hall", size), about.robot)


class Gatherer(Stage):
    """Gathers all rooms."""

    room = Input(Room, many=True)
    rooms = Output(Rooms, topic="/rooms")

    def __init__(self):
        self.all = []

    def on_room(self, room, about):
        self.all.append(Room(room.header, f"{room.name} {len(self.all) + 1}", room.size))
        self.rooms.send(Rooms(self.all))
