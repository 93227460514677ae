#!/usr/bin/env bash
# Gets an API server of Kubernetes, which Debian has as source alone, and what it runs with:
#   tests/kubernetes_tools.sh FOLDER      leaves kube-apiserver, etcd and kubectl in FOLDER
# Everything comes from Debian 12 by apt, nothing is installed; the server is compiled with Debian's Go,
# which takes five minutes of a processor and 3 GiB for the while. Does nothing when they are there.
# Exits with 77 (skipped) where apt cannot get them.
set -euo pipefail
mkdir -p "$1"
folder=$(cd "$1" && pwd)
[ ! -x "$folder/kube-apiserver" ] || exit 0
skip() { echo "skipped: $1"; exit 77; }
command -v apt-get >/dev/null || skip "apt-get is not installed"
keys=/usr/share/keyrings/debian-archive-keyring.gpg
[ -r "$keys" ] || skip "Debian's keys are not installed"

work=$folder/work
rm -rf "$work"
mkdir -p "$work/lists/partial" "$work/archives/partial" "$work/tools" "$work/gopath/src/k8s.io" "$work/home"
trap 'chmod -R u+w "$work"; rm -rf "$work"' EXIT
cd "$work"
# Lists of our own: this machine's may have no sources.
for kind in deb deb-src; do
  echo "$kind [signed-by=$keys] http://deb.debian.org/debian bookworm main"
done >sources.list
own_apt() {
  apt-get -qq -o "Dir::Etc::SourceList=$work/sources.list" -o Dir::Etc::SourceParts=- \
    -o "Dir::State::Lists=$work/lists" -o "Dir::Cache=$work" -o "Dir::Cache::Archives=$work/archives" \
    -o APT::Sandbox::User=root "$@" 2>&1
}
own_apt update || skip "Debian's packages cannot be reached"
own_apt download golang-1.19-go golang-1.19-src etcd-server kubernetes-client || skip "Debian's packages cannot be reached"
own_apt source --download-only kubernetes || skip "the source of Kubernetes cannot be reached"
for package in *.deb; do dpkg-deb --extract "$package" tools; done
tar --extract --file kubernetes_*.orig.tar.gz
for tree in kubernetes-[0-9]*/; do version=$(basename "${tree#kubernetes-}"); done
mv "kubernetes-$version" source
ln -s "$work/source" gopath/src/k8s.io/kubernetes

# As Debian's rules build kubectl: by path, with the libraries that the source brings along.
export GOROOT=$work/tools/usr/lib/go-1.19 GOPATH=$work/gopath GOCACHE=${GOCACHE:-$work/cache} HOME=$work/home
export GO111MODULE=off GOPROXY=off CGO_ENABLED=0 PATH=$work/tools/usr/lib/go-1.19/bin:$PATH
name=k8s.io/kubernetes
cd "gopath/src/$name"
go build -trimpath -o "$work/openapi-gen" $name/vendor/k8s.io/kube-openapi/cmd/openapi-gen
# What the server tells kubectl of its fields is made from the types.
types=$(grep -rl --include='*.go' -e '+k8s:openapi-gen=' staging/src pkg | xargs -n 1 dirname | sort -u |
  sed "s#^staging/src/#$name/vendor/#; s#^pkg#$name/pkg#" | paste -sd,)
touch "$work/header"
"$work/openapi-gen" -i "$types" -p $name/pkg/generated/openapi -O zz_generated.openapi -h "$work/header" \
  -r "$work/report" --output-base "$work/gopath/src"
# The source of a release says its version in its folder's name alone.
sed -i "s/\(gitVersion *= *\)\"[^\"]*\"/\1\"v$version\"/" staging/src/k8s.io/component-base/version/base.go
go build -trimpath -ldflags '-s -w' -o "$work/kube-apiserver" $name/cmd/kube-apiserver
mv "$work/tools/usr/bin/etcd" "$work/tools/usr/bin/kubectl" "$work/kube-apiserver" "$folder/"
