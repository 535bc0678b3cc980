#!/usr/bin/env bash
# mcap for Python: Writer(repeat_channels=False) writes a file that the same package's reader refuses with KeyError.
#
# Guess: the option only saves copies in the summary, and the reader takes the channels from the chunks, where each
# stands before its first message; or the writer refuses it beside indexes that need the copies.
# Seen with mcap 1.6.0: the file is written without complaint, and make_reader(...).iter_messages() raises KeyError with
# the number of a channel (repeat_schemas=False: of a schema). The format demands the copies if chunk indexes are there,
# and the writer leaves out only the copies. NonSeekingReader reads all messages of the same bytes, and so does
# make_reader if indexes and statistics are left out too. So such a recording looks broken though all its messages are
# whole; an importer must collect channels and schemas from the data section as well.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check mcap==1.6.0
"$folder/venv/bin/python" - <<'PYTHON'
import io
import sys

import mcap
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import IndexType, Writer

print(f"mcap {mcap.__version__}")


def read(reader, **options):
    stream = io.BytesIO()
    writer = Writer(stream, **options)
    writer.start()
    schema = writer.register_schema("name", "jsonschema", b"{}")
    channel = writer.register_channel("/topic", "json", schema)
    for time in (1, 2, 3):
        writer.add_message(channel, log_time=time, publish_time=time, data=b"{}")
    writer.finish()
    try:
        return [message.log_time for _, _, message in reader(io.BytesIO(stream.getvalue())).iter_messages()]
    except KeyError as error:
        return repr(error)


found = []
bare = {"repeat_channels": False, "index_types": IndexType.NONE, "use_statistics": False}
for options in ({}, {"repeat_channels": False}, {"repeat_schemas": False}, bare):
    found += [read(make_reader, **options), read(NonSeekingReader, **options)]
    print(f"{options}: make_reader {found[-2]}, NonSeekingReader {found[-1]}")
times = [1, 2, 3]
sys.exit(found != [times, times, "KeyError(1)", times, "KeyError(1)", times, times, times])
PYTHON
