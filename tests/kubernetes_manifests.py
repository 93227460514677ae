#!/usr/bin/env python3
"""Checks deploy/kubernetes against the models of the Kubernetes API and against our own programs.

    tests/kubernetes_manifests.py SOURCE_DIR BIN_DIR      exits with 77 when python3-kubernetes is missing

Every field must be one that the API knows; every flag one that the program has; the autoscaler must
ask for a metric that the coordinator serves, and share it out by the threads of a worker.
"""

import json
import pathlib
import re
import subprocess
import sys

from kubernetes_fields import lost_fields

try:
    import yaml
    from kubernetes import client
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

MODELS = {
    "Service": "V1Service",
    "StatefulSet": "V1StatefulSet",
    "Deployment": "V1Deployment",
    # Debian's client is of the time before v2, which has the same fields.
    "HorizontalPodAutoscaler": "V2beta2HorizontalPodAutoscaler",
}


class Answer:
    """What ApiClient.deserialize reads."""

    def __init__(self, data):
        self.data = json.dumps(data)


def containers(manifest):
    return manifest["spec"].get("template", {}).get("spec", {}).get("containers", [])


def flags_of(program, bin_dir):
    text = subprocess.run([bin_dir / program[0], *program[1:], "--help"], check=True, text=True,
                          stdout=subprocess.PIPE).stdout
    return set(re.findall(r"--[a-z][a-z-]*", text))


def wrong_flags(command, bin_dir):
    program = command[:2] if command[0] == "weft" else command[:1]
    known = flags_of(program, bin_dir)
    return [word for word in command[len(program):] if word.split("=")[0] not in known]


def check_manifest(manifest, bin_dir):
    wrong = []
    api = client.ApiClient()
    kind = manifest["kind"]
    read = api.sanitize_for_serialization(api.deserialize(Answer(manifest), MODELS[kind]))
    wrong += [f"{kind}: the API knows no {path}" for path in lost_fields(manifest, read)]
    for container in containers(manifest):
        commands = [container["args"]]
        for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
            if probe in container:
                commands.append(container[probe]["exec"]["command"])
        for command in commands:
            wrong += [f"{kind}: {command[0]} has no {flag}"
                      for flag in wrong_flags(command, bin_dir)]
        if container["securityContext"].get("readOnlyRootFilesystem") is not True:
            wrong.append(f"{kind}: its root file system can be written")
        if not any(mount["mountPath"] == "/tmp" for mount in container["volumeMounts"]):
            wrong.append(f"{kind}: it has no /tmp")
    pod = manifest["spec"].get("template", {}).get("spec")
    if pod and not pod["securityContext"].get("runAsNonRoot"):
        wrong.append(f"{kind}: it may run as root")
    return wrong


def check_autoscaler(manifests, source):
    worker = next(m for m in manifests if m["kind"] == "Deployment")
    threads = next(arg.split("=")[1] for arg in containers(worker)[0]["args"]
                   if arg.startswith("--threads="))
    scaler = next(m for m in manifests if m["kind"] == "HorizontalPodAutoscaler")
    wrong = []
    external = scaler["spec"]["metrics"][0]["external"]
    if external["target"]["averageValue"] != threads:
        wrong.append(f"the autoscaler shares out by {external['target']['averageValue']}, "
                     f"a worker has {threads} threads")
    if scaler["spec"]["scaleTargetRef"]["name"] != worker["metadata"]["name"]:
        wrong.append("the autoscaler scales something else than the workers")
    served = "\n".join(path.read_text() for path in (source / "coordinator").rglob("*.cpp"))
    if f'"{external["metric"]["name"]}"' not in served:
        wrong.append(f"the coordinator serves no {external['metric']['name']}")
    return wrong


def main():
    source, bin_dir = (pathlib.Path(path) for path in sys.argv[1:3])
    manifests = []
    for path in sorted((source / "deploy" / "kubernetes").glob("*.yaml")):
        manifests += list(yaml.safe_load_all(path.read_text()))
    wrong = [line for manifest in manifests for line in check_manifest(manifest, bin_dir)]
    wrong += check_autoscaler(manifests, source)
    print("\n".join(wrong) if wrong else f"{len(manifests)} manifests are right")
    return 1 if wrong else 0


sys.exit(main())
