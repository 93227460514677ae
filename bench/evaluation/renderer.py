"""Drawing, recording and time: what every part of the evaluation works with."""

import hashlib
import json
import pathlib
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
BIN = ROOT / "build" / "bin"

# What is compared, by name: the scene's integration and what else the request says. The references
# are `path` (path tracing with what the precomputation models) and `truth` (all of it).
METHODS = {
    "path": ("integrator: INTEGRATOR_PATH local: true", {}),
    "truth": ("integrator: INTEGRATOR_PATH", {}),
    "precomputed": ("integrator: INTEGRATOR_PRECOMPUTED", {}),
    "device": ("integrator: INTEGRATOR_PRECOMPUTED", {"device": "auto"}),
    # The paper's search for the fibre: the nearest midpoint, by so many samples of a tetrahedron.
    "device-32": ("integrator: INTEGRATOR_PRECOMPUTED", {"device": "auto", "nearest_samples": 32}),
    "device-64": ("integrator: INTEGRATOR_PRECOMPUTED", {"device": "auto", "nearest_samples": 64}),
    "device-128": ("integrator: INTEGRATOR_PRECOMPUTED",
                   {"device": "auto", "nearest_samples": 128}),
    "dual": ("integrator: INTEGRATOR_DUAL local: true", {}),
    "prt": ("integrator: INTEGRATOR_PRT", {}),
}


def say(text):
    print(text, file=sys.stderr, flush=True)


class Renderer:
    """One bench_draw_pictures, started when it is needed, that keeps fabrics loaded."""

    def __init__(self, program=BIN / "bench_draw_pictures"):
        self.program = program
        self.process = None

    def draw(self, request):
        if self.process is None or self.process.poll() is not None:
            if not self.program.exists():
                sys.exit(f"{self.program} is not there; make it with "
                         "`cmake --build build --target bench_draw_pictures`")
            self.process = subprocess.Popen([self.program], stdin=subprocess.PIPE,
                                            stdout=subprocess.PIPE, text=True)
        self.process.stdin.write(json.dumps(request) + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            return {"error": f"the renderer ended with status {self.process.wait()}"}
        return json.loads(answer)

    def close(self):
        if self.process is not None:
            self.process.stdin.close()
            self.process.wait()
            self.process = None


class Record:
    """Finished cases, one JSON object a line, found again by what they were made from."""

    def __init__(self, path, forget=()):
        self.path = path
        self.cases = {}
        if path.exists():
            for line in path.read_text().splitlines():
                try:
                    case = json.loads(line)
                    self.cases[case["key"]] = case
                except (ValueError, KeyError):
                    continue  # the last line of a run that was stopped
        if forget:
            self.cases = {key: case for key, case in self.cases.items()
                          if case["inputs"].get("method") not in forget}
            path.write_text("".join(json.dumps(case) + "\n" for case in self.cases.values()))

    def find(self, inputs):
        case = self.cases.get(self.key(inputs))
        return case and case["answer"]

    def keep(self, inputs, answer):
        case = {"key": self.key(inputs), "inputs": inputs, "answer": answer}
        self.cases[case["key"]] = case
        with self.path.open("a") as file:
            file.write(json.dumps(case) + "\n")

    def of_part(self, part):
        return [case for case in self.cases.values() if case["inputs"]["part"] == part]

    @staticmethod
    def key(inputs):
        return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()[:24]


class Deadline:
    def __init__(self, minutes):
        self.end = time.monotonic() + 60 * minutes

    def over(self):
        return time.monotonic() >= self.end

    def minutes_left(self):
        return max(0.0, (self.end - time.monotonic()) / 60)


class Fabric:
    """A database, with what `weft inspect` says of it."""

    def __init__(self, path):
        self.path = pathlib.Path(path).resolve()
        shown = subprocess.run([BIN / "weft", "inspect", self.path, "--json"],
                               stdout=subprocess.PIPE, text=True, check=False)
        if shown.returncode != 0:
            sys.exit(f"{path} is not a fabric database that can be read")
        self.about = json.loads(shown.stdout)
        self.name = self.path.stem
        self.digest = self.about["content_digest"]
        self.tile_mm = self.about["size_mm"]


class Bench:
    """Draws what has not been drawn yet, and remembers it."""

    def __init__(self, record, settings):
        self.record = record
        self.settings = settings
        self.renderer = Renderer()
        self.failed = 0

    def draw(self, inputs, fabric, scene, seed, request=None):
        """The answer to one picture; None when it failed (said on stderr, tried again next time).

        `inputs` names the case: part, method and configuration. What it was drawn from is added.
        """
        integration, extra = METHODS[inputs["method"]]
        whole = dict(extra, **(request or {}))
        scattering = inputs.get("scattering")
        scene = (f"{scene}integration {{ {integration} seed: {seed}"
                 f"{' scattering: ' + scattering if scattering else ''} }}\n")
        inputs = dict(inputs, fabric=fabric.name, digest=fabric.digest,
                      drawn=Record.key({"scene": scene, "request": {
                          k: v for k, v in whole.items() if not k.endswith("picture")
                          and k not in ("preview", "against", "against_error", "folder")}}))
        found = self.record.find(inputs)
        if found is not None:
            return found
        answer = self.renderer.draw(dict(whole, fabric=str(fabric.path), scene=scene))
        if "error" in answer:
            self.failed += 1
            say(f"{fabric.name} {inputs['method']}: {answer['error']}")
            return None
        self.record.keep(inputs, answer)
        return answer
