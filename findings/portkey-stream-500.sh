#!/usr/bin/env bash
# Portkey's gateway: each streamed answer is replaced by a 500, while plain answers pass.
#
# Guess: with "stream": true the events of the model's server pass through the gateway unchanged.
# Seen with @portkey-ai/gateway 1.15.2 (hono 4.13.19, @hono/node-server 1.19.19) on Node 20.20.2 and 24.21.0: the
# server's 200 with events is read, and the client gets 500 {"status": "failure", "message": "Something went wrong"},
# which is no OpenAI error. The gateway's log says "TypeError: immutable". The server has done, and counted, the work.
# So a client that streams, and tries again after a 500, pays for every try and gets nothing; without "stream" all is
# well.
set -eu
folder=$(mktemp -d)
trap 'kill "${gateway:-}" 2>/dev/null || true; rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund --ignore-scripts @portkey-ai/gateway@1.15.2 \
  hono@4.13.19 @hono/node-server@1.19.19 >/dev/null
port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
node node_modules/@portkey-ai/gateway/build/start-server.js --port="$port" --headless >/dev/null 2>&1 &
gateway=$!
NO_PROXY=127.0.0.1 PORT=$port python3 - <<'PYTHON'
import http.server
import json
import os
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request

with open("node_modules/@portkey-ai/gateway/package.json") as file:
    version = json.load(file)["version"]
node = subprocess.run(["node", "--version"], capture_output=True, text=True, check=True).stdout.strip()
print(f"@portkey-ai/gateway {version}, Node {node}")
asked = []
choice = {"index": 0, "finish_reason": "stop"}
common = {"id": "1", "created": 1, "model": "m"}


class Server(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        stream = json.loads(self.rfile.read(int(self.headers["Content-Length"]))).get("stream", False)
        asked.append(stream)
        text = {"role": "assistant", "content": "B"}
        name, kind = ("delta", "chat.completion.chunk") if stream else ("message", "chat.completion")
        body = json.dumps({**common, "object": kind, "choices": [{**choice, name: text}]})
        if stream:
            body = f"data: {body}\n\ndata: [DONE]\n\n"
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream" if stream else "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body.encode())

    def log_message(self, *_):
        pass


server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Server)
threading.Thread(target=server.serve_forever, daemon=True).start()
gateway = f"http://127.0.0.1:{os.environ['PORT']}"
headers = {"Content-Type": "application/json", "Authorization": "Bearer none", "x-portkey-provider": "openai"}
headers["x-portkey-custom-host"] = f"http://127.0.0.1:{server.server_port}/v1"
question = {"model": "m", "messages": [{"role": "user", "content": "?"}]}


def ask(stream):
    body = json.dumps({**question, "stream": stream}).encode()
    request = urllib.request.Request(f"{gateway}/v1/chat/completions", body, headers)
    try:
        response = urllib.request.urlopen(request, timeout=30)
    except urllib.error.HTTPError as error:
        response = error
    return response.status, response.read().decode()


for _ in range(120):
    try:
        urllib.request.urlopen(gateway, timeout=5).read()
        break
    except OSError:
        time.sleep(0.5)
plain, streamed = ask(False), ask(True)
print(f"plain: {plain[0]} {plain[1][:40]}...")
print(f"stream: {streamed[0]} {streamed[1]}; the server was asked {len(asked)} times")
failure = {"status": "failure", "message": "Something went wrong"}
sys.exit(not (plain[0] == 200 and streamed[0] == 500 and json.loads(streamed[1]) == failure and len(asked) == 2))
PYTHON
