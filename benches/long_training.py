#!/usr/bin/env python3
"""Trains a year of days on twenty years of daily returns through the service. It prints the first estimate of the total time, the time
itself, and the accuracy that the policy claims.

    cargo build --release
    benches/long_training.py [--horizon 250] [--returns 5000] [--mean 0.0006]

The returns are draws of a normal law with a deviation of 1 % a day, the bank pays 0.01 %, and the utility is power utility of risk
aversion 3. Everything else is the default of the service: the radius of alpha 0.1, an accuracy of 0.5 basis points. It needs
Linux to measure the memory.
"""
import argparse
import json
import os
import random
import re
import subprocess
import tempfile
import time
import urllib.request


def call(url, body=None):
    request = urllib.request.Request(url, body and json.dumps(body).encode(), {"content-type": "application/json"})
    with urllib.request.urlopen(request) as answer:
        return json.load(answer)


def largest_resident(process):
    with open(f"/proc/{process.pid}/status") as status:
        return int(re.search(r"VmHWM:\s+(\d+)", status.read()).group(1)) / 1e3


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--horizon", type=int, default=250)
    parser.add_argument("--returns", type=int, default=5000)
    parser.add_argument("--mean", type=float, default=0.0006)
    options = parser.parse_args()
    draw = random.Random(5)
    history = [round(draw.gauss(options.mean, 0.01), 6) for _ in range(options.returns)]
    utility = {"kind": "power", "risk_aversion": 3}
    problem = {"horizon": options.horizon, "rate_per_step": 0.0001, "history": history, "utility": utility}
    ballast = os.environ.get("BALLAST", "target/release/ballast")
    with tempfile.TemporaryDirectory() as folder:
        command = [ballast, "serve", "--listen", "127.0.0.1:0", "--data", folder]
        service = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        try:
            port = re.search(r":(\d+)\s*$", service.stdout.readline()).group(1)
            url = f"http://127.0.0.1:{port}"
            job, started, first = call(f"{url}/train", {"problem": problem})["job"], time.time(), None
            while (state := call(f"{url}/jobs/{job}"))["state"] in ("queued", "running"):
                left = state["progress"]["seconds_left"]
                if first is None and left is not None:
                    first = time.time() - started + left
                    print(f"after {time.time() - started:.0f} s: the service estimates {first:.0f} s in all", flush=True)
                time.sleep(1)
            print(f"{state['state']} after {time.time() - started:.0f} s, {largest_resident(service):.0f} MB at most")
            steps = call(f"{url}/policies/{state['policy']}")["diagnostics"]
            most, claim = max(step["design_count"] for step in steps), steps[0]["expected_error"]["total"]
            print(f"at most {most} design points a step; it claims an accuracy of {claim:.2f} basis points")
        finally:
            service.terminate()
            service.wait()


if __name__ == "__main__":
    main()
