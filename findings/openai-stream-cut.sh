#!/usr/bin/env bash
# openai for Python: a stream cut in the middle of an event ends like a whole one, and the half event is dropped.
#
# Guess: half a line of JSON at the end of the body raises JSONDecodeError or APIError, as a cut body without a stream
# raises APIConnectionError.
# Seen with openai 3.57.0 (httpx2 2.16.2): the loop ends without error after the last whole event, also if the event was
# complete but for its blank line, and stream().get_final_completion() returns the shortened answer with finish_reason
# None. So an answer that a proxy cut off counts as short, and a letter in the last event is lost. A caller must ask for
# a finish_reason.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check openai==3.57.0
NO_PROXY=127.0.0.1 "$folder/venv/bin/python" - <<'PYTHON'
import http.server
import importlib.metadata
import json
import sys
import threading

import openai

print(f"openai {openai.__version__}, httpx2 {importlib.metadata.version('httpx2')}")
parts = []


def chunk(text, index=0, finish=None, **more):
    delta = {"role": "assistant", "content": text}
    choice = {"index": index, "delta": delta, "finish_reason": finish}
    start = {"id": "1", "object": "chat.completion.chunk", "created": 1, "model": "m"}
    return "data: " + json.dumps({**start, "choices": [choice], **more}) + "\n\n"


class Server(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        self.rfile.read(int(self.headers["Content-Length"]))
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.end_headers()
        self.wfile.write("".join(parts).encode())

    def log_message(self, *_):
        pass


server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Server)
threading.Thread(target=server.serve_forever, daemon=True).start()
client = openai.OpenAI(api_key="none", base_url=f"http://127.0.0.1:{server.server_port}/v1")
question = {"model": "m", "messages": [{"role": "user", "content": "?"}]}
DONE = "data: [DONE]\n\n"



def read(*what):
    parts[:] = what
    texts = [piece.choices[0].delta.content for piece in client.chat.completions.create(stream=True, **question)]
    with client.chat.completions.stream(**question) as stream:
        choice = stream.get_final_completion().choices[0]
    return texts, choice.message.content, choice.finish_reason


whole = read(chunk("not "), chunk("B", finish="stop"), DONE)
half = read(chunk("not "), chunk("B", finish="stop")[:40])
no_blank_line = read(chunk("not "), chunk("B", finish="stop").rstrip())
for name, found in {"whole": whole, "cut in the event": half, "cut before the blank line": no_blank_line}.items():
    print(f"{name}: chunks {found[0]}, final {found[1]!r}, finish_reason {found[2]}")
cut = (["not "], "not ", None)
sys.exit(not (whole == (["not ", "B"], "not B", "stop") and half == no_blank_line == cut))
PYTHON
