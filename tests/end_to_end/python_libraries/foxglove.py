"""Opens a live view as the Foxglove app does, by the protocol `foxglove.sdk.v1` and with the library `websockets`.

Arguments: the address (ws://HOST:PORT), and the topics to wait for. Prints, as JSON, what the first message of each holds, read by
the definition that the server has sent for it. With `--halt` in place of topics it subscribes to everything that there is, and
reads nothing any more.
"""

import asyncio
import json
import struct
import sys

from mcap_ros2._dynamic import generate_dynamic
from websockets.asyncio.client import connect

TIMEOUT = 120


async def subscribe(socket, channels):
    subscriptions = [{"id": channel["id"], "channelId": channel["id"]} for channel in channels]
    await socket.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))


def decode(channel, data):
    name, encoding = channel["schemaName"], channel["encoding"]
    if encoding == "json":
        assert channel["schemaEncoding"] == "jsonschema" and json.loads(channel["schema"])["title"] == name, channel
        return json.loads(bytes(data))
    assert (encoding, channel["schemaEncoding"]) == ("cdr", "ros2msg"), channel
    decoders = generate_dynamic(name, channel["schema"])
    decoder = decoders.get(name) or decoders[name.replace("/msg/", "/")]
    return decoder(data)


def told(message):
    if isinstance(message, dict):
        return message
    if hasattr(message, "info"):
        known = sum(1 for cell in message.data if cell >= 0)
        return {"frame": message.header.frame_id, "cells": len(message.data), "known": known}
    if hasattr(message, "transforms"):
        return {"frames": sorted(one.child_frame_id for one in message.transforms)}
    if hasattr(message, "markers"):
        return {"markers": len(message.markers)}
    return {}


async def main(address, wanted):
    # Without a limit: the messages are maps.
    async with connect(address, subprotocols=["foxglove.sdk.v1"], max_size=None) as socket:
        assert socket.subprotocol == "foxglove.sdk.v1", socket.subprotocol
        channels, found = {}, {}
        while wanted == ["--halt"] or not set(wanted) <= set(found):
            message = await asyncio.wait_for(socket.recv(), TIMEOUT)
            if isinstance(message, str):
                said = json.loads(message)
                if said["op"] != "advertise":
                    continue
                new = [one for one in said["channels"] if wanted == ["--halt"] or one["topic"] in wanted]
                channels.update((one["id"], one) for one in new)
                await subscribe(socket, new)
                if wanted == ["--halt"]:
                    print("halted", flush=True)
                    socket.transport.pause_reading()
                    await asyncio.sleep(10 * TIMEOUT)
            elif message[0] == 1:
                subscription, log_time = struct.unpack_from("<IQ", message, 1)
                channel = channels[subscription]
                found.setdefault(channel["topic"], {"log_time": log_time, **told(decode(channel, message[13:]))})
        print(json.dumps(found))


asyncio.run(main(sys.argv[1], sys.argv[2:]))
