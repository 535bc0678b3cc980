#!/usr/bin/env bash
# LiteLLM: a refused key (401) or unknown model (404) turns into 429 from the next request on; the server is not asked.
#
# Guess: with one server behind a model name there is nothing to switch to, so that each 401 reaches the client as 401.
# Seen with LiteLLM 1.108.7 and its defaults: the Router gives 401 once, then 429, "No deployments available", for 5 s,
# without a request to the server; the same with 404, but not with 400. The proxy gives one to three 401 before that,
# adds Retry-After: 1, and refuses valid requests in that time too. So a client that waits and repeats on 429, as it
# should, never stops on a wrong key, and its log shows a rate limit that does not exist.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check litellm==1.108.7 openai==3.57.0
export LITELLM_LOCAL_MODEL_COST_MAP=True NO_PROXY=127.0.0.1
"$folder/venv/bin/python" - <<'PYTHON' 2>/dev/null
import http.server
import importlib.metadata
import json
import sys
import threading

import litellm
import openai

print(f"litellm {importlib.metadata.version('litellm')}, openai {openai.__version__}")
litellm.suppress_debug_info = True
asked = []


class Server(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        self.rfile.read(int(self.headers["Content-Length"]))
        status = int(self.path.split("/")[1])
        asked.append(status)
        body = json.dumps({"error": {"message": "no", "type": "no", "param": None, "code": None}}).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        pass


server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Server)
threading.Thread(target=server.serve_forever, daemon=True).start()


def statuses(status):
    url = f"http://127.0.0.1:{server.server_port}/{status}/v1"
    where = {"model": "openai/m", "api_base": url, "api_key": "none"}
    router = litellm.Router([{"model_name": "m", "litellm_params": where}])
    asked.clear()
    found = []
    for _ in range(6):
        try:
            router.completion(model="m", messages=[{"role": "user", "content": "?"}])
        except Exception as error:
            found.append(getattr(error, "status_code", None) or type(error).__name__)
    print(f"server says {status}: client sees {found}, server asked {len(asked)} times")
    return found, len(asked)


good = True
for status in (401, 404):
    found, count = statuses(status)
    good &= found[0] == status and found[-1] == 429 and count == found.count(status) < 6
sys.exit(not (good and statuses(400) == ([400] * 6, 6)))
PYTHON
