#!/usr/bin/env bash
# openai for Python: a base_url with a query gets the path glued behind the query, so that the server sees no endpoint.
#
# Guess: base_url "http://host/v1?key=1" asks for /v1/chat/completions?key=1.
# Seen with openai 3.57.0 (httpx2 2.16.2): the request line is /v1/?key=1chat/completions, a path of /v1/ with a spoilt
# key. No error is raised; a server that serves by prefix may even answer. default_query={"key": "1"} gives the right
# line. So an address that works in curl or in a configuration of another client ends in 404 or in a refused key.
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
asked = []
message = {"role": "assistant", "content": "B"}
choice = {"index": 0, "finish_reason": "stop", "message": message}
answer = {"id": "1", "object": "chat.completion", "created": 1, "model": "m", "choices": [choice]}


class Server(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        self.rfile.read(int(self.headers["Content-Length"]))
        asked.append(self.path)
        body = json.dumps(answer).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        pass


server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Server)
threading.Thread(target=server.serve_forever, daemon=True).start()
root = f"http://127.0.0.1:{server.server_port}/v1"
for options in ({"base_url": root + "?key=1"}, {"base_url": root, "default_query": {"key": "1"}}):
    client = openai.OpenAI(api_key="none", **options)
    client.chat.completions.create(model="m", messages=[{"role": "user", "content": "?"}])
    shown = {**options, "base_url": options["base_url"].replace(str(server.server_port), "PORT")}
    print(f"{shown}: {asked[-1]}")
sys.exit(asked != ["/v1/?key=1chat/completions", "/v1/chat/completions?key=1"])
PYTHON
