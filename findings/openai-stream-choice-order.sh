#!/usr/bin/env bash
# openai for Python: the stream() helper raises IndexError if the second of two choices speaks first.
#
# Guess: with n=2 the helper files every chunk under its "index", whichever choice comes first, as the plain stream
# does.
# Seen with openai 3.57.0 (httpx2 2.16.2): IndexError: list assignment index out of range, from within the SDK, when the
# first chunk has index 1. With index 0 first both choices are right. The format sets no order, and a server that makes
# two answers at once sends whichever is ready. So such a run fails now and then, by timing, with an error that is no
# openai.APIError.
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
    parts[:] = [*what, DONE]
    plain = [(piece.choices[0].index, piece.choices[0].delta.content) for piece in
             client.chat.completions.create(stream=True, n=2, **question)]
    try:
        with client.chat.completions.stream(n=2, **question) as stream:
            helper = [(choice.index, choice.message.content) for choice in stream.get_final_completion().choices]
    except Exception as error:
        helper = f"{type(error).__name__}: {error}", isinstance(error, openai.OpenAIError)
    return plain, helper


zero, one = chunk("zero", 0, "stop"), chunk("one", 1, "stop")
in_order, swapped = read(zero, one), read(one, zero)
print(f"0 first: plain {in_order[0]}, helper {in_order[1]}")
print(f"1 first: plain {swapped[0]}, helper {swapped[1][0]}")
right = [(0, "zero"), (1, "one")]
good = in_order == (right, right) and swapped[0] == right[::-1]
sys.exit(not (good and swapped[1] == ("IndexError: list assignment index out of range", False)))
PYTHON
