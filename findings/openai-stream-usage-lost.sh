#!/usr/bin/env bash
# openai for Python: the stream() helper forgets the token usage if a chunk without it follows.
#
# Guess: get_final_completion().usage is the last usage that the server sent, whichever chunk carried it.
# Seen with openai 3.57.0 (httpx2 2.16.2): it is None if the usage came with a text chunk and a later chunk has none,
# and right only if it comes with the last chunk. The usage is in the plain stream in both cases. So with servers that
# report usage early, costs and token counts are missing although they were sent.
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

usage = {"usage": {"prompt_tokens": 10, "completion_tokens": 2, "total_tokens": 12}}


def read(*what):
    parts[:] = [*what, DONE]
    pieces = client.chat.completions.create(stream=True, **question)
    sent = [piece.usage.total_tokens for piece in pieces if piece.usage]
    with client.chat.completions.stream(**question) as stream:
        final = stream.get_final_completion().usage
    return sent, final.total_tokens if final else None


early = read(chunk("a"), chunk("b", **usage), chunk("c", finish="stop"))
late = read(chunk("a"), chunk("b"), chunk("c", finish="stop", **usage))
print(f"usage before the last chunk: plain stream {early[0]}, helper {early[1]}")
print(f"usage in the last chunk: plain stream {late[0]}, helper {late[1]}")
sys.exit(not (early == ([12], None) and late == ([12], 12)))
PYTHON
