#!/usr/bin/env bash
# Applies deploy/kubernetes to an API server of Kubernetes, by the commands of docs/kubernetes.md. There are
# no nodes and no controllers: the server takes or refuses what it is given, and starts nothing.
#   tests/kubernetes_apiserver.sh BUILD_DIR [TOOLS]
#     TOOLS   folder with kube-apiserver, etcd and kubectl. Default: BUILD_DIR/kubernetes, where
#             tests/kubernetes_tools.sh gets them at the first time (minutes, network)
# Exits with 77 (skipped) where these cannot be had, and where there are no namespaces.
set -euo pipefail
build=$(cd "$1" && pwd)
tools=${2:-$build/kubernetes}
source_dir=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

if [ "${WEFT_KUBERNETES_INSIDE:-}" != 1 ]; then
  "$source_dir/tests/kubernetes_tools.sh" "$tools"
  enter=(unshare --mount --net --pid --fork --kill-child --mount-proc)
  [ "$(id -u)" -eq 0 ] || enter+=(--user --map-root-user)
  "${enter[@]}" true 2>/dev/null || { echo "skipped: no namespaces can be had here (unshare)"; exit 77; }
  WEFT_KUBERNETES_INSIDE=1 exec "${enter[@]}" "${BASH_SOURCE[0]}" "$build" "$tools"
fi

work=$(mktemp -d)
clean_up() {
  status=$?
  if [ "$status" -ne 0 ]; then
    tail -n 30 "$work"/*.log >&2 || true
  fi
  for pid in ${server:-} ${etcd:-}; do
    kill "$pid" 2>/dev/null || true
    wait "$pid" 2>/dev/null || true
  done
  rm -rf "$work"
}
trap clean_up EXIT
ip link set lo up
# The server wants an address that others could reach.
ip address add 192.0.2.1/32 dev lo

mkdir -p "$work/home/.kube" "$work/page/deploy"
export HOME=$work/home PATH=$tools:$build/bin:$PATH
fail() { echo "$*" >&2; exit 1; }
start_server() {
  etcd --data-dir "$work/etcd" --listen-client-urls http://127.0.0.1:2379 \
    --advertise-client-urls http://127.0.0.1:2379 --listen-peer-urls http://127.0.0.1:2380 >"$work/etcd.log" 2>&1 &
  etcd=$!
  openssl genrsa -out "$work/accounts.key" 2048 2>/dev/null
  echo 'operator-token,operator,1,system:masters' >"$work/tokens.csv"
  kube-apiserver --etcd-servers http://127.0.0.1:2379 --cert-dir "$work/server" --bind-address 127.0.0.1 \
    --secure-port 6443 --advertise-address 192.0.2.1 --service-cluster-ip-range 10.0.0.0/24 \
    --authorization-mode RBAC --token-auth-file "$work/tokens.csv" --service-account-issuer https://localhost \
    --service-account-key-file "$work/accounts.key" --service-account-signing-key-file "$work/accounts.key" \
    >"$work/server.log" 2>&1 &
  server=$!
  cat >"$HOME/.kube/config" <<CONFIG
apiVersion: v1
kind: Config
clusters: [{name: here, cluster: {server: "https://127.0.0.1:6443", certificate-authority: $work/server/apiserver.crt}}]
users: [{name: operator, user: {token: operator-token}}]
contexts: [{name: here, context: {cluster: here, user: operator}}]
current-context: here
CONFIG
  for _ in $(seq 300); do
    kubectl get --raw /readyz >/dev/null 2>&1 && return
    kill -0 "$server" 2>/dev/null || break
    sleep 0.3
  done
  fail "the API server does not start"
}
start_server

# A reader's copy; version 1.20 knows the autoscaler's fields by an older name.
cp -r "$source_dir/deploy/kubernetes" "$work/page/deploy/"
versions=$(kubectl api-versions)
if ! grep -qx autoscaling/v2 <<<"$versions"; then
  grep -qx autoscaling/v2beta2 <<<"$versions"
  sed -i 's#^apiVersion: autoscaling/v2$#apiVersion: autoscaling/v2beta2#' "$work/page/deploy/kubernetes/autoscaler.yaml"
fi
{
  echo "set -ex; cd '$work/page'"
  # The certificates first, as the page has it.
  /usr/bin/python3 - "$source_dir" <<'PYTHON'
import pathlib, sys
sys.path.insert(0, sys.argv[1] + "/tests")
import docs_blocks
name = "docs/kubernetes.md"
blocks, _ = docs_blocks.read_page(name, (pathlib.Path(sys.argv[1]) / name).read_text())
print("\n".join(block.text for block in blocks if block.language == "sh" and not block.by))
PYTHON
  /usr/bin/python3 "$source_dir/tests/docs_commands.py" "$source_dir" --print docs/kubernetes.md \
    tests/kubernetes_apiserver.sh
} >"$work/documented.sh"
bash "$work/documented.sh" >"$work/documented.log" 2>&1 || fail "the commands of docs/kubernetes.md failed"

cd "$work/page"
for name in weft-coordinator weft-worker; do
  held=$(kubectl get secret $name-tls -o 'go-template={{range $key, $value := .data}}{{$key}} {{end}}')
  [ "$held" = "$(find "$HOME/.config/weft/certs/$name" -type f -printf '%f\n' | sort | tr '\n' ' ')" ] ||
    fail "the secret of $name holds $held"
  [[ $held == *"cert.pem key.pem"* ]] || fail "the secret of $name holds $held"
done
# The server keeps every field; a second time it has nothing to change. (kubectl says "configured" of a
# StatefulSet all the same, because the server fills claims in.)
changes() {
  kubectl get -f deploy/kubernetes -o \
    'go-template={{range .items}}{{.kind}}/{{.metadata.name}} {{.metadata.resourceVersion}}{{"\n"}}{{end}}'
}
changes >"$work/once.log"
kubectl apply -f deploy/kubernetes >"$work/again.log"
diff "$work/once.log" <(changes) || fail "applied again, something changes"
[ "$(wc -l <"$work/once.log")" -eq "$(cat deploy/kubernetes/*.yaml | grep -c '^kind:')" ] || fail "something is missing"
kubectl get -f deploy/kubernetes -o json >"$work/kept.json"
/usr/bin/python3 - "$work/kept.json" deploy/kubernetes "$source_dir" <<'PYTHON'
import json, pathlib, sys
import yaml
sys.path.insert(0, sys.argv[3] + "/tests")
from kubernetes_fields import lost_fields
kept = {(item["kind"], item["metadata"]["name"]): item for item in json.loads(pathlib.Path(sys.argv[1]).read_text())["items"]}
lost = []
for path in sorted(pathlib.Path(sys.argv[2]).glob("*.yaml")):
    for written in yaml.safe_load_all(path.read_text()):
        lost += lost_fields(written, kept[written["kind"], written["metadata"]["name"]], written["kind"])
sys.exit("\n".join(f"the server did not keep {path}" for path in lost) or 0)
PYTHON

# Pods as the controllers would ask for them, by all that admits or refuses a pod.
kubectl create serviceaccount default >/dev/null
/usr/bin/python3 - "$work/kept.json" >"$work/pods.json" <<'PYTHON'
import json, pathlib, sys
pods = []
for item in json.loads(pathlib.Path(sys.argv[1]).read_text())["items"]:
    if "template" in item["spec"]:
        template = item["spec"]["template"]
        spec = dict(template["spec"])
        # What a StatefulSet adds by itself.
        for claim in item["spec"].get("volumeClaimTemplates", []):
            name = claim["metadata"]["name"]
            spec["volumes"] = spec["volumes"] + [{"name": name, "persistentVolumeClaim": {"claimName": name}}]
        pods.append({"apiVersion": "v1", "kind": "Pod",
                     "metadata": {"name": item["metadata"]["name"], "labels": template["metadata"]["labels"]},
                     "spec": spec})
print(json.dumps({"apiVersion": "v1", "kind": "List", "items": pods}))
PYTHON
[ "$(kubectl create --dry-run=server -f "$work/pods.json" | grep -c '^pod/.* created')" -eq 2 ] || fail "a pod is refused"

# It does refuse what is wrong.
wrong() {
  sed "$1" deploy/kubernetes/worker.yaml >"$work/wrong.yaml"
  cmp --quiet "$work/wrong.yaml" deploy/kubernetes/worker.yaml && fail "'$1' changes nothing"
  if kubectl apply -f "$work/wrong.yaml" >"$work/wrong.log" 2>&1; then fail "'$1' is not refused"; fi
}
wrong 's/runAsNonRoot/runAsNobody/'
wrong 's/mountPath: \/scratch/mountPath: ""/'
wrong 's/secretName: weft-worker-tls, defaultMode: 0440/secretName: weft-worker-tls, defaultMode: 04400/'
wrong 's/{name: scratch, mountPath/{name: other, mountPath/'
echo "$(kube-apiserver --version) takes $(wc -l <"$work/once.log") manifests and the pods that they ask for"
