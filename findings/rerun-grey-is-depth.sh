#!/usr/bin/env bash
# Rerun: importing an MCAP file turns grey camera images, mono8 and mono16, into depth images.
#
# Guess: a ROS image with the encoding mono8 becomes an Image of 8-bit grey, and only 16UC1 and 32FC1 become a
# DepthImage.
# Seen with rerun-sdk 0.41.0 and rosbags 0.11.9: mono8, mono16, 8UC1 and 16UC1 all become a DepthImage, without a scale
# ("meter"), and rgb8 becomes an Image. So whatever takes a DepthImage for distances takes a night camera for one, and a
# query for Image components after the import finds no grey camera.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  rerun-sdk==0.41.0 rosbags==0.11.9 numpy==2.4.6 pyarrow==26.0.1
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_HUMBLE)
Image, Header = store.types["sensor_msgs/msg/Image"], store.types["std_msgs/msg/Header"]
Time = store.types["builtin_interfaces/msg/Time"]
with Writer("bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
    for encoding, size in {"mono8": 1, "8UC1": 1, "mono16": 2, "16UC1": 2, "rgb8": 3}.items():
        data = np.arange(8 * size, dtype=np.uint8)
        image = Image(Header(Time(5, 0), "camera"), 2, 4, encoding, 0, 4 * size, data)
        topic = writer.add_connection(f"/{encoding}", Image.__msgtype__, typestore=store)
        writer.write(topic, 10_000_000_000, store.serialize_cdr(image, Image.__msgtype__))
PYTHON
HOME="$folder" "$folder/venv/bin/rerun" mcap convert bag/bag.mcap -o bag.rrd >/dev/null 2>&1
"$folder/venv/bin/python" - <<'PYTHON'
import importlib.metadata
import sys

from rerun.chunk import RrdReader

print(f"rerun-sdk {importlib.metadata.version('rerun-sdk')}, rosbags {importlib.metadata.version('rosbags')}")
found = {}
for chunk in RrdReader("bag.rrd").stream():
    names = chunk.to_record_batch().schema.names
    kinds = {name.split(":")[0] for name in names if name.split(":")[0] in ("Image", "DepthImage")}
    if kinds:
        found[str(chunk.entity_path)] = (sorted(kinds), "DepthImage:meter" in names)
for path, (kinds, meter) in sorted(found.items()):
    print(f"{path}: {', '.join(kinds)}{', with meter' if meter else ''}")
depth = (["DepthImage"], False)
grey = {f"/{encoding}": depth for encoding in ("mono8", "8UC1", "mono16", "16UC1")}
sys.exit(found != {**grey, "/rgb8": (["Image"], False)})
PYTHON
