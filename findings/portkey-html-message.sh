#!/usr/bin/env bash
# Portkey's gateway: an HTML page from the model's server becomes {"html-message": ...} under its own status, even 200.
#
# Guess: a body that is no JSON becomes an OpenAI-style {"error": ...}, with 502 where the server said 200.
# Seen with @portkey-ai/gateway 1.15.2 and Node 20.20.2: 200 stays 200 and 503 stays 503, as application/json with the
# page in "html-message", and neither "choices" nor "error". A client that reads "choices" finds none in the first, and
# no error text in the second. So a maintenance or login page before the model counts as an answer.
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
status = 200


class Server(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        self.rfile.read(int(self.headers["Content-Length"]))
        page = b"<html><body>Down for maintenance</body></html>"
        self.send_response(status)
        self.send_header("Content-Type", "text/html")
        self.send_header("Content-Length", str(len(page)))
        self.end_headers()
        self.wfile.write(page)

    def log_message(self, *_):
        pass


server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Server)
threading.Thread(target=server.serve_forever, daemon=True).start()
gateway = f"http://127.0.0.1:{os.environ['PORT']}"
headers = {"Content-Type": "application/json", "Authorization": "Bearer none", "x-portkey-provider": "openai"}
headers["x-portkey-custom-host"] = f"http://127.0.0.1:{server.server_port}/v1"
question = json.dumps({"model": "m", "messages": [{"role": "user", "content": "?"}]}).encode()


def ask():
    request = urllib.request.Request(f"{gateway}/v1/chat/completions", question, headers)
    try:
        response = urllib.request.urlopen(request, timeout=30)
    except urllib.error.HTTPError as error:
        response = error
    return response.status, response.headers["Content-Type"].split(";")[0], sorted(json.load(response))


for _ in range(120):
    try:
        urllib.request.urlopen(gateway, timeout=5).read()
        break
    except OSError:
        time.sleep(0.5)
found = []
for status in (200, 503):
    found.append(ask())
    print(f"server {status} text/html: client gets {found[-1][0]} {found[-1][1]} with the keys {found[-1][2]}")
sys.exit(found != [(status, "application/json", ["html-message"]) for status in (200, 503)])
PYTHON
